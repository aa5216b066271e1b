//! Names of enumerations in the ASCII form (OEM7 commands and logs reference manual).

use crate::codec::Names;

/// Solution status of a computed solution.
pub const SOLUTION_COMPUTED: u32 = 0;

pub(super) const SOLUTION_STATUS: Names = &[
    (0, "SOL_COMPUTED"),
    (1, "INSUFFICIENT_OBS"),
    (2, "NO_CONVERGENCE"),
    (3, "SINGULARITY"),
    (4, "COV_TRACE"),
    (5, "TEST_DIST"),
    (6, "COLD_START"),
    (7, "V_H_LIMIT"),
    (8, "VARIANCE"),
    (9, "RESIDUALS"),
    (10, "DELTA_POS"),
    (11, "NEGATIVE_VAR"),
    (13, "INTEGRITY_WARNING"),
    (14, "INS_INACTIVE"),
    (15, "INS_ALIGNING"),
    (16, "INS_BAD"),
    (17, "IMU_UNPLUGGED"),
    (18, "PENDING"),
    (19, "INVALID_FIX"),
    (20, "UNAUTHORIZED"),
    (22, "INVALID_RATE"),
];

pub(super) const SOLUTION_TYPE: Names = &[
    (0, "NONE"),
    (1, "FIXEDPOS"),
    (2, "FIXEDHEIGHT"),
    (8, "DOPPLER_VELOCITY"),
    (16, "SINGLE"),
    (17, "PSRDIFF"),
    (18, "WAAS"),
    (19, "PROPAGATED"),
    (20, "OMNISTAR"),
    (32, "L1_FLOAT"),
    (33, "IONOFREE_FLOAT"),
    (34, "NARROW_FLOAT"),
    (48, "L1_INT"),
    (49, "WIDE_INT"),
    (50, "NARROW_INT"),
    (51, "RTK_DIRECT_INS"),
    (52, "INS_SBAS"),
    (53, "INS_PSRSP"),
    (54, "INS_PSRDIFF"),
    (55, "INS_RTKFLOAT"),
    (56, "INS_RTKFIXED"),
    (57, "INS_OMNISTAR"),
    (58, "INS_OMNISTAR_HP"),
    (59, "INS_OMNISTAR_XP"),
    (64, "OMNISTAR_HP"),
    (65, "OMNISTAR_XP"),
    (66, "CDGPS"),
    (67, "EXT_CONSTRAINED"),
    (68, "PPP_CONVERGING"),
    (69, "PPP"),
    (70, "OPERATIONAL"),
    (71, "WARNING"),
    (72, "OUT_OF_BOUNDS"),
    (73, "INS_PPP_CONVERGING"),
    (74, "INS_PPP"),
    (77, "PPP_BASIC_CONVERGING"),
    (78, "PPP_BASIC"),
    (79, "INS_PPP_BASIC_CONVERGING"),
    (80, "INS_PPP_BASIC"),
];

pub(super) const DATUM: Names = &[(61, "WGS84"), (63, "USER")];
pub(super) const CLOCK_STATUS: Names = &[
    (0, "VALID"),
    (1, "CONVERGING"),
    (2, "ITERATING"),
    (3, "INVALID"),
];
pub(super) const UTC_STATUS: Names = &[(0, "INVALID"), (1, "VALID"), (2, "WARNING")];
pub(super) const INERTIAL_STATUS: Names = &[
    (0, "INS_INACTIVE"),
    (1, "INS_ALIGNING"),
    (2, "INS_HIGH_VARIANCE"),
    (3, "INS_SOLUTION_GOOD"),
    (6, "INS_SOLUTION_FREE"),
    (7, "INS_ALIGNMENT_COMPLETE"),
    (8, "DETERMINING_ORIENTATION"),
    (9, "WAITING_INITIALPOS"),
    (10, "WAITING_AZIMUTH"),
    (11, "INITIALIZING_BIASES"),
    (12, "MOTION_DETECT"),
    (14, "WAITING_ALIGNMENTORIENTATION"),
];
