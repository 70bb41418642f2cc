"""The parts that models are composed of: lobes of facets and bodies below them, one short class a part."""
