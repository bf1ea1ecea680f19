"""Grasps that were made elsewhere or earlier: recordings and what replays them."""
