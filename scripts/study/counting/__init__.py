"""FLOPs and bytes: declared costs, and the back ends that measure them."""
