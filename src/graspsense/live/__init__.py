"""A grasp on a page while it goes on, and for observers in processes of their own."""
