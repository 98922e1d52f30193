#pragma once

#include "server/diagnose/scan.h"

namespace trammel {

/// How sure the name of a cause is.
struct Naming {
  double frequency = 1;              ///< share of repetitions of the batch, the effect as fitted, that name it
  std::vector<Cause> could_also_be;  ///< explain the data as well
};

/// Doubts the family at `place` in `seen`: by repeating the batch in simulation with the effect as it was fitted, and
/// by what other named causes explain of the data and of that effect.
[[nodiscard]] Naming name_or_doubt(const std::vector<FamilyPtr>& families, const Background& background,
                                   const Eigen::MatrixXd& null, const Eigen::VectorXd& data, const Scan& seen,
                                   std::size_t place);

}  // namespace trammel
