#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

/// Batches in the formats of other programs, and recognising a format.
namespace trammel {

/// Reads the measurements of a RoboDK calibration or validation project, exported as CSV. The
/// separator is the first of `;`, tab and `,` that occurs in the first line; with `;` or tab a
/// number may have a decimal comma. Values separated by commas, without column names and without
/// any decimal point, are refused: the commas could also be decimal commas. `#` and `//` start
/// comments. There are two layouts:
///
/// Named, where the first line names `J1` ... `Jn` (or `Joint 1` ..., `Axis 1` ..., `A1` ..., `q1`
/// ...; n to 12), in any order, without regard to case, blanks and underscores, units in brackets
/// or behind an underscore:
///
///     joints (deg; rad or mm where it says so), X Y Z (mm; m or in where it says so), at most one
///     of A B C (Rz(A) Ry(B) Rx(C)), W P R (Rz(R) Ry(P) Rx(W)), O A T (Rz(O) Ry(A) Rz(T)),
///     Rx Ry Rz (Rx(rx) Ry(ry) Rz(rz)), deg or rad; rvx rvy rvz, a rotation vector, rad, as
///     Universal Robots' Rx Ry Rz are; qw qx qy qz, Hamilton, unit; and pose_id (id, name, point,
///     target). Other columns are kept as they are.
///
/// By position, with or without a first line of other names. RoboDK's validation macros read such
/// exports (joints, measured position, tool centre point in F):
///
///     q1..q6 deg, x y z mm                                                     9 columns
///     q1..q6 deg, x y z mm, TCP x y z mm                                      12 columns
///     q1..q6 deg, x y z mm, rx ry rz rad, TCP x y z mm, TCP rx ry rz rad      18 columns, Rx(rx)
///     Ry(ry) Rz(rz)
///
/// The TCP is kept in columns `tcp_...`. If it differs between rows, each value becomes a tool:
/// `tcp-1`, `tcp-2`, ... in the order of their first rows. The cell file must use these names.
///
/// Refuses the same as parse_batch_csv(), angles of more than a whole turn in a column of radians
/// (they must be degrees), and a TCP that differs in most rows. The error names `where`, row,
/// column, value and limit, and says so if columns were taken by position.
[[nodiscard]] Result<MeasurementBatch> parse_robodk_csv(const std::string& text,
                                                        const std::string& where);
[[nodiscard]] Result<MeasurementBatch> read_robodk_csv(const std::string& path);

/// Reads a table without a header, or with one that is ignored. The caller gives the columns: names
/// of a batch's columns in their order, `skip` for a column to ignore. `_rad` and `_m` mean the
/// same column as `_deg` and `_mm`: `q1_rad`, `x_m`. The separator is the first of `;`, tab, `,`
/// and blanks that occurs in the first line; `#` and `//` start comments; with `;`, tab or blanks a
/// number may have a decimal comma. Refuses a row of another length, and the same as
/// parse_batch_csv().
[[nodiscard]] Result<MeasurementBatch> parse_batch_table(const std::string& text,
                                                         const std::vector<std::string>& columns,
                                                         const std::string& where);
[[nodiscard]] Result<MeasurementBatch> read_batch_table(const std::string& path,
                                                        const std::vector<std::string>& columns);

enum class BatchKind { kTrammel, kRoboDk, kPoints };

/// The kind of the text if it is certain, otherwise kTrammel, whose reader then reports the missing
/// columns. RoboDK: a first line with J1 or Joint 1 and so on but no column of ours (`q1_deg`,
/// `x_mm`); or other names above rows of 12 or 18 numbers. Points: a text that parse_points() reads
/// without options.
[[nodiscard]] BatchKind recognise_batch(const std::string& text);

/// Reads a batch of either kind, by parse_batch_csv() or parse_robodk_csv(). Refuses points; the
/// error explains how to make a batch from them.
[[nodiscard]] Result<MeasurementBatch> parse_batch(const std::string& text,
                                                   const std::string& where);
[[nodiscard]] Result<MeasurementBatch> read_batch(const std::string& path);

}  // namespace trammel
