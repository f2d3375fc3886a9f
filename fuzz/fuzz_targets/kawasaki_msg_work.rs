#![cfg_attr(fuzzing, no_main)]

cellwire_fuzz::program!(cellwire_fuzz::kawasaki_work::kawasaki_msg_work);
