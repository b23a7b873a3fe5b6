//! Services: SDO transfers, PDO mapping, transmission types, NMT, guarding, quirks.
