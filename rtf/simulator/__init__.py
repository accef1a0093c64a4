"""A simulated iCub on MuJoCo: mechanics, sensors, cameras and motor boards."""
