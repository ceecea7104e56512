"""What skin is made of: absorption and scattering of its chromophores, the layers that they make at a wavelength."""
