#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

/// Batches in the formats of other programs, and recognising a format.
namespace trammel {

/// Reads the measurements of a RoboDK calibration or validation project, exported as CSV. Fields
/// are separated by `;`, tab or `,`, by the first of these that is in the first line; with `;` or
/// tab a number may have a decimal comma. Commas between values without names and without any
/// decimal point are refused: they may stand in numbers, too. `#` and `//` start comments. Two
/// layouts:
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
/// By position, with or without a first line of other names, as the exports have them that RoboDK's
/// validation macros read (joints, what was measured, the tool centre point in F):
///
///     q1..q6 deg, x y z mm                                                     9 columns
///     q1..q6 deg, x y z mm, TCP x y z mm                                      12 columns
///     q1..q6 deg, x y z mm, rx ry rz rad, TCP x y z mm, TCP rx ry rz rad      18 columns, Rx(rx)
///     Ry(ry) Rz(rz)
///
/// The TCP is kept in columns `tcp_...`. Where it is not the same in every row, each one is a tool
/// of its own: `tcp-1`, `tcp-2`, ... in the order of their first rows, to be named so in the cell
/// file.
///
/// Refuses, naming `where`, row, column, value and limit, what parse_batch_csv() refuses, angles of
/// more than a whole turn in a column of radians (they must be degrees), and a TCP that is another
/// one in most rows. Of columns that were taken by position the refusal says so.
[[nodiscard]] Result<MeasurementBatch> parse_robodk_csv(const std::string& text,
                                                        const std::string& where);
[[nodiscard]] Result<MeasurementBatch> read_robodk_csv(const std::string& path);

/// Reads a table without a header, whose columns somebody tells: names of a batch's columns in
/// their order, `skip` for one that is passed over. `_rad` and `_m` stand for the same column in
/// `_deg` and `_mm`: `q1_rad`, `x_m`. Values are separated by `;`, tab, `,` or blanks, by the first
/// of these that is in the first line; `#` and `//` start comments; with `;`, tab or blanks a
/// number may have a decimal comma. Refuses a row of another length, and what parse_batch_csv()
/// refuses.
[[nodiscard]] Result<MeasurementBatch> parse_batch_table(const std::string& text,
                                                         const std::vector<std::string>& columns,
                                                         const std::string& where);
[[nodiscard]] Result<MeasurementBatch> read_batch_table(const std::string& path,
                                                        const std::vector<std::string>& columns);

enum class BatchKind { kTrammel, kRoboDk, kPoints };

/// The kind of the text if it is certain, else kTrammel: that reader reports what is missing.
/// RoboDK: a first line that names J1 or Joint 1 and on, without a column of ours (`q1_deg`,
/// `x_mm`); or other names above rows of 12 or 18 numbers. Points: a text that parse_points() reads
/// without options.
[[nodiscard]] BatchKind recognise_batch(const std::string& text);

/// Reads a batch of either kind, by parse_batch_csv() or parse_robodk_csv(). Refuses points; the
/// error says how to make a batch of them.
[[nodiscard]] Result<MeasurementBatch> parse_batch(const std::string& text,
                                                   const std::string& where);
[[nodiscard]] Result<MeasurementBatch> read_batch(const std::string& path);

}  // namespace trammel
