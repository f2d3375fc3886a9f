#![cfg_attr(fuzzing, no_main)]
cellwire_fuzz::target!(isra_ball_host);
