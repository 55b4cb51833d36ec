//! impinge-scenes
