//! One receiver port: NovAtel, SBF and NMEA mixed.
