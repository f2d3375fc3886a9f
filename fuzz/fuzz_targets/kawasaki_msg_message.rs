#![cfg_attr(fuzzing, no_main)]

cellwire_fuzz::program!(cellwire_fuzz::kawasaki_msg::kawasaki_msg_message);
