"""A simulated iCub on MuJoCo: the mechanics, what is mounted on them, and the boards that move them."""
