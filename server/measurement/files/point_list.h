#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/measurement/files/joint_list.h"
#include "server/measurement/files/point_options.h"
#include "server/measurement/measurement.h"

/// Points and frames that the software of a tracker exports: positions without the commanded
/// joints.
namespace trammel {

struct NamedPoint {
  std::string name;                ///< of the target or frame
  Vector3 p_W = Vector3::Zero();   ///< m, in the file's working frame
  std::optional<Matrix3> R_W;      ///< of a frame, active W <- frame
  std::optional<double> sigma;     ///< m, of one axis
  std::optional<double> time;      ///< s, Unix time
  std::vector<std::string> extra;  ///< values of the list's extra columns
  int row = 0;                     ///< line in its file, for messages
};

struct PointList {
  std::string where;  ///< the file as messages name it
  std::vector<NamedPoint> points;
  std::vector<std::string> extra_columns =
      {};  ///< additional columns of tracker software: the air, time stamps
};

/// Reads the ASCII exports of SpatialAnalyzer (its manual: "Exporting ASCII Formatted Points",
/// "Export Frames"), and any list of named points with a header line, `name,x_mm,y_mm,z_mm` among
/// them.
///
/// Lines: one point each. Empty lines are skipped; `//` and `#` start comments. The separator is
/// the first of `;`, tab, `,` and blanks that occurs in the first line of data. A name that
/// contains the separator needs double quotes. Of a name with collection and group,
/// `Collection::Group::p1`, the last component counts. Between `;`, tabs or blanks a number may
/// have a decimal comma. If commas separate values without a header and no number has a decimal
/// point, the file is refused. Time stamps at the end of a line (fields with `/` or `:`, AM, PM, an
/// ISO date) are skipped.
///
/// Layouts without a header line, recognised by the number of fields, which is the same in every
/// line:
///
///     [[collection] group] target  c1 c2 c3                 4 to 6 fields
///     [[collection] group] target  c1 c2 c3  u1 u2 u3       7 to 9 fields: coordinate
///     uncertainties
///     [[collection] group] frame   c1 c2 c3  rx ry rz       7 to 9 fields: fixed XYZ angles, deg
///     [[collection] group] frame   c1 c2 c3  rz ry rx       7 to 9 fields: Euler ZYX angles, deg
///
/// With 7 to 9 fields a comment (`fixed XYZ`, `XYZ fixed`, `fixed angles`, `Euler ZYX`, `ZYX
/// Euler`, `uncertainties`) or `options.behind` must say which of the three it is. A number with a
/// decimal point where a name belongs is refused.
///
/// Layouts with a header. The header is the first line of data, or a comment with as many fields
/// that names a point and three coordinates. Columns may be in any order; names are compared
/// without case, blanks and underscores: `name` (`point`, `target`, `frame`, each also with
/// `name`), `x y z`, `r theta z` or `r theta phi`; optional `ux uy uz` (`ur utheta uz`, `ur utheta
/// uphi`), `sigma`, `rx ry rz` (in this order or as `rz ry rx`). Other columns are skipped. Units
/// may stand in brackets or behind an underscore: `X (mm)`, `x_mm`, `theta [rad]`. Up to 30 lines
/// above the header, in which a program describes the file, are skipped.
///
/// Files of Leica Tracker Pilot have also `pointid`; `u95` of the point (k = 2, of its three axes
/// together: sigma of one axis is U95 / (2 sqrt 3)) or `u95x u95y u95z`; a unit quaternion `qw qx
/// qy qz` or `q0 q1 q2 q3`, active W <- frame; a `timestamp` (`2026-11-22 10:11:12.3`, `22.11.2026
/// 10:11:12`, taken for UTC, or Unix time), which else stays as text; `temperature`, `pressure`,
/// `humidity` of the air, which are kept as `air_temperature_c`, `air_pressure_hpa`,
/// `air_humidity_percent`.
///
/// Coordinates: cartesian; cylindrical R, theta (from +x about +z), z; spherical R, theta (the
/// same), phi (from +z). A comment with `cylindric`, `spherical` or `polar` says so. Angles are deg
/// unless `Angular units: rad` or the header says otherwise. Lengths are mm unless a comment
/// `Units: inches`, the header or `options.unit` says m or inch. Rotation of a frame: Rz(rz) Ry(ry)
/// Rx(rx), for both kinds of angles. Uncertainties become one sigma of an axis: the root mean
/// square of the three, in metres, over `options.coverage`; three zeros mean that none was
/// recorded.
///
/// Refuses, naming file, row, column, value and limit: no points, another number of fields, a value
/// that is not a number or too large (1 km), a negative radius or uncertainty, a repeated name,
/// other Euler angles, statements that contradict each other.
[[nodiscard]] Result<PointList> parse_points(const std::string& text, const std::string& where,
                                             const PointFileOptions& options = {});
[[nodiscard]] Result<PointList> read_points(const std::string& path,
                                            const PointFileOptions& options = {});

/// A batch of the points and the commanded poses: each point measures the pose whose pose_id is the
/// name of the point (the last component counts in both). With `in_order` the first point measures
/// the first pose, and so on: names do not count, and both lists must have the same length. The
/// batch has the order of the points, which is the order in time. Poses without a point are left
/// out. Refuses a point without a pose, a pose_id twice, and lists without a point.
[[nodiscard]] Result<MeasurementBatch> join_points(const PointList& points,
                                                   const JointList& commanded,
                                                   bool in_order = false);

}  // namespace trammel
