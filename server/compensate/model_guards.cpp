#include "server/compensate/model_guards.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace trammel {

namespace {

/// m, of an axis.
double left_of_an_axis(const CompensatedModel::Parts& parts) {
  const double sigma = parts.physics.cell->tracker.sigma;
  const double all = parts.training.compensated.rms / std::sqrt(3.0);
  // The discrepancy counts neither what the rows' own sigmas explain nor single bad poses.
  return std::min(all, std::hypot(parts.discrepancy, sigma));
}

}  // namespace

std::string to_string(Severity severity) {
  switch (severity) {
    case Severity::kNote:
      return "note";
    case Severity::kLeads:
      return "leads";
    case Severity::kHolds:
      return "holds";
  }
  return "note";
}

double sigmas_left(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  const double sigma = parts.physics.cell->tracker.sigma;
  if (parts.training.poses == 0 || sigma <= 0) return 1;
  const double left = left_of_an_axis(parts);
  return std::isfinite(left) ? std::max(1.0, left / sigma) : 1;
}

std::vector<Note> guards_of(const CompensatedModel& model) {
  const double sigmas = sigmas_left(model);
  if (sigmas < kNotedSigmas) return {};
  const bool holds = sigmas >= kHeldSigmas;
  const CompensatedModel::Parts& parts = model.parts();
  std::string text = fmt::format(
      "{:.0f} times the stated sigma is left at the training poses ({:.3f} mm an axis, stated {:.3f} mm): the "
      "intervals "
      "were widened to fit, so their coverage does not show that the model is right",
      sigmas, to_mm(left_of_an_axis(parts)), to_mm(parts.physics.cell->tracker.sigma));
  if (holds) text += "; a person must look at it before it is used";
  return {{"left_beyond_sigma", holds ? Severity::kHolds : Severity::kLeads, std::move(text)}};
}

}  // namespace trammel
