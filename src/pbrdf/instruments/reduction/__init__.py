"""From frames to Stokes parameters with covariance, pixel by pixel and averaged over regions."""
