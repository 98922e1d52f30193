#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"

/// Whether poses can separate two physical causes.
namespace trammel {

/// Two causes in a model that has every other source of the cell as well.
struct CausePair {
  PhysicalModel model;                ///< at planning_values()
  std::string cause, other;           ///< as requested
  std::vector<Eigen::Index> columns;  ///< the parameters of `cause`
  std::vector<Eigen::Index> rest;     ///< all others, which could imitate it
};

/// The cell's own sources, `cause` and `other` (specs as in the cell file). Refuses two specs of
/// the same source, and the same as make_error_source().
[[nodiscard]] Result<CausePair> make_cause_pair(const std::shared_ptr<const Cell>& cell,
                                                const std::string& cause, const std::string& other);

/// The part of one parameter's effect that a least-squares fit of all other parameters (with their
/// priors) leaves.
struct ParameterSeparation {
  std::string parameter;
  double effect = 0;    ///< |effect|^2 / sigma^2 for one prior scale of the parameter
  double strength = 0;  ///< |remaining effect|^2 / sigma^2
  double share =
      0;  ///< |remaining effect| / |the effect|, 0 to 1; 0 if these poses do not show the effect
};

struct Separability {
  double strength =
      0;  ///< of the whole cause: geometric mean of 1 + strength over its directions, less 1
  std::vector<ParameterSeparation> parameters;  ///< of the cause
};

/// `information` is that of the pair's model from the poses in question, without priors
/// (information_of()).
[[nodiscard]] Separability separability(const CausePair& pair, const Eigen::MatrixXd& information);

/// Below this strength (a squared signal-to-noise ratio) nothing should be claimed.
constexpr double kLeastStrength = 15;
/// Below this share a fit takes the effect for that of others, and no plan can compensate for that.
constexpr double kLeastShare = 0.02;

/// The change that is needed besides, for people: `a second known payload, or a run without any`.
[[nodiscard]] std::string what_would_separate(const std::string& cause, const std::string& other);

}  // namespace trammel
