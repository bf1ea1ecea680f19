"""Files as tables and arrays, without their meaning: text, ARFF, NPY and NPZ, MAT, HDF5, Parquet, ROS bags and MCAP."""
