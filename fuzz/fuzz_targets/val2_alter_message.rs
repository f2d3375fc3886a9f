#![cfg_attr(fuzzing, no_main)]
cellwire_fuzz::target!(val2_alter_message);
