"""The paper's experiment from end to end, on simulated frames, and the paper's statements tested on the model.

The paper: Zhang, Song, Zhao, "Double-Gauss polarimetric BRDF model of painted surfaces", Infrared and Laser Engineering
46(11), 1117002 (2017). It published no raw data: everything made here is simulated, and says so.
"""
