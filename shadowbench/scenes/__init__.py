"""What is lit: scenes, cameras and lights, from files and shapes. Knows neither GL nor Embree."""
