"""Classifiers that come with graspsense: scikit-learn's, behind the common role."""
