#![cfg_attr(fuzzing, no_main)]

cellwire_fuzz::program!(cellwire_fuzz::val2_viewer::val2_viewer_decoder);
