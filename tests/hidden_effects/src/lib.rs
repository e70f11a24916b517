//! Rigs with an effect hidden in the data: an independent generator and a scorer
