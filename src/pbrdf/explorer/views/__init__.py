"""The views: what each draws of the state, as float16 buffers for its twin in ``page/views``."""
