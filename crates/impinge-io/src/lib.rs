//! impinge-io
