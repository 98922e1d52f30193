#pragma once

#include <string>
#include <vector>

#include "server/measurement/files/point_list.h"

/// Localisation by reference reflectors. These are fixed points of the cell, measured when the
/// world frame was set up and again later. They show whether the tracker has moved, and how far.
/// Thesis 3.2.4 (five reflectors).
namespace trammel {

struct ReferenceOptions {
  double localise_above = 20e-6;  ///< m, rms of the differences
  double repeat_above = 100e-6;   ///< m
};

enum class ReferenceVerdict {
  kFine,              ///< rms <= localise_above: go on measuring
  kLocalise,          ///< apply the transform to all measurements from now on
  kLocaliseAndRepeat  ///< rms > repeat_above: also repeat the test before this check
};

struct ReferenceResidual {
  std::string name;
  Vector3 difference_W = Vector3::Zero();  ///< measured - reference, as measured, m
  Vector3 remaining_W = Vector3::Zero();   ///< residual after the transform, m
};

struct ReferenceCheck {
  ReferenceVerdict verdict = ReferenceVerdict::kFine;
  /// W as the references define it, from the W of the new measurement: p_reference = X p_measured.
  /// Least squares.
  Pose X_WV = Pose::Identity();
  double rms = 0;            ///< m, of |difference_W|
  double rms_remaining = 0;  ///< m, of |remaining_W|
  /// rms_remaining <= repeat_above: one rigid motion explains the differences. Otherwise a
  /// reflector has moved, and the transform must not be used.
  bool rigid = true;
  std::vector<ReferenceResidual> residuals;  ///< in the order of the references
  std::string worst;                         ///< reflector with the largest |remaining_W|
  std::vector<std::string> not_measured;     ///< references that the new measurement lacks
};

/// Assumes that both measurements are from the same station. Refuses fewer than 3 common
/// reflectors, reflectors on a line, a measured reflector without a reference of that name, and
/// limits that violate 0 < localise <= repeat.
[[nodiscard]] Result<ReferenceCheck> check_references(const PointList& references,
                                                      const PointList& measured,
                                                      const ReferenceOptions& options = {});

/// The batch in the world frame of the references: positions and orientations are transformed by
/// `X_WV`, and source_text is written anew.
[[nodiscard]] MeasurementBatch localised(MeasurementBatch batch, const Pose& X_WV);

}  // namespace trammel
