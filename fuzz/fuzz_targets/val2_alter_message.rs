#![cfg_attr(fuzzing, no_main)]

cellwire_fuzz::program!(cellwire_fuzz::val2_alter::val2_alter_message);
