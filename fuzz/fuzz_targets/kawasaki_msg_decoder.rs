#![cfg_attr(fuzzing, no_main)]
cellwire_fuzz::target!(kawasaki_msg_decoder);
