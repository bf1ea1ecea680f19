"""The classifiers of graspsense, from scikit-learn."""
