#![cfg_attr(fuzzing, no_main)]
cellwire_fuzz::target!(mmacell_proto_central);
