"""What cars with cameras see: `picture` takes the pictures as `nathlon.sim.camera_spec` describes them."""
