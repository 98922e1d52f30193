#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"

/// The question whether poses can tell two physical causes apart.
namespace trammel {

/// Two causes in a model that has every other source of the cell as well.
struct CausePair {
  PhysicalModel model;                ///< at planning_values()
  std::string cause, other;           ///< as asked for
  std::vector<Eigen::Index> columns;  ///< the parameters of `cause`
  std::vector<Eigen::Index> rest;     ///< all others: what could imitate it
};

/// The cell's own sources, `cause` and `other` (specs as in the cell file). Refuses two that are
/// the same source and what make_error_source() refuses.
[[nodiscard]] Result<CausePair> make_cause_pair(const std::shared_ptr<const Cell>& cell,
                                                const std::string& cause, const std::string& other);

/// The rest that a least-squares fit of all other parameters (with their priors) leaves of the
/// effect of one.
struct ParameterSeparation {
  std::string parameter;
  double effect = 0;    ///< |effect|^2 / sigma^2 of one prior scale of it
  double strength = 0;  ///< |what is left|^2 / sigma^2 of it
  double share =
      0;  ///< |what is left| / |the effect|, 0 to 1; 0 where these poses do not show the effect
};

struct Separability {
  double strength =
      0;  ///< of the whole cause: geometric mean of 1 + strength over its directions, less 1
  std::vector<ParameterSeparation> parameters;  ///< of the cause
};

/// `information` is that of the pair's model from the poses in question, without any prior
/// (information_of()).
[[nodiscard]] Separability separability(const CausePair& pair, const Eigen::MatrixXd& information);

/// Below this strength (a squared signal-to-noise ratio) nothing should be claimed.
constexpr double kLeastStrength = 15;
/// Below this share a fit takes the effect for that of others: no plan makes up for it.
constexpr double kLeastShare = 0.02;

/// The change that is needed besides, for people: `a second known payload, or a run without any`.
[[nodiscard]] std::string what_would_separate(const std::string& cause, const std::string& other);

}  // namespace trammel
