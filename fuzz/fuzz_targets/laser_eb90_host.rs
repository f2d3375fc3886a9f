#![cfg_attr(fuzzing, no_main)]
cellwire_fuzz::target!(laser_eb90_host);
