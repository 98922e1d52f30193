#include "server/calibrate/refit.h"

#include <algorithm>
#include <set>

#include "server/calibrate/frames/refit_frames.h"
#include "server/calibrate/identify/check_needs.h"
#include "server/calibrate/identify/gauss_newton.h"
#include "server/calibrate/identify/identify.h"

namespace trammel {

using causes::Part;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// Tools, or payloads, of the cell, in the order in which a source has parameters for each.
std::vector<std::string> owners(const ErrorSource& source, const Cell& cell) {
  std::vector<std::string> ids;
  if (source.cause().part == Part::kTool) {
    for (const auto& [id, X_FT] : cell.tools) ids.push_back(id);
  } else if (source.cause().part == Part::kPayload) {
    for (const auto& [id, payload] : cell.payloads) ids.push_back(id);
  }
  return ids;
}

Status check_has_all(const PhysicalModel& model, const Cell& cell) {
  for (const auto& [id, X_FT] : model.tools) {
    if (!cell.tools.contains(id))
      return refused("cell {}: the model to start from knows tool '{}'", cell.name, id)
          .of("tools")
          .with_text(id);
  }
  for (const auto& [id, payload] : model.cell->payloads) {
    if (!cell.payloads.contains(id))
      return refused("cell {}: the model to start from knows payload '{}'", cell.name, id)
          .of("payloads")
          .with_text(id);
  }
  return {};
}

/// The index, in `after`, of each parameter of `before`, the same source in another cell.
std::vector<Index> places(const ErrorSource& before, const Cell& cell_before,
                          const ErrorSource& after, const Cell& cell_after) {
  std::vector<Index> place(before.parameters().size());
  const std::vector<std::string> ids = owners(before, cell_before);
  const std::vector<std::string> ids_after = owners(after, cell_after);
  const std::size_t each = ids.empty() ? place.size() : place.size() / ids.size();
  for (std::size_t k = 0; k < place.size(); ++k) {
    const std::size_t owner =
        ids.empty()
            ? 0
            : static_cast<std::size_t>(
                  std::find(ids_after.begin(), ids_after.end(), ids[k / each]) - ids_after.begin());
    place[k] = static_cast<Index>(owner * each + k % each);
  }
  return place;
}

/// The full name of the source that `name` means in the model; a cause means its present form. A
/// missing source is added, and the indices in `place` move.
Result<std::string> named_source(PhysicalModel& model, const std::string& name,
                                 std::vector<Index>& place) {
  std::vector<std::string> names = alternatives(name, *model.cell);
  names.insert(names.begin(), name);
  for (const ErrorSourcePtr& source : model.sources) {
    if (contains(names, source->name())) return source->name();
  }
  ErrorSourcePtr added = TRY(make_error_source(name, *model.cell));
  std::string full_name = added->name();
  const auto count = static_cast<Index>(added->parameters().size());
  const Index first = add_source(model, std::move(added));
  for (Index& one : place) one += one >= first ? count : 0;
  return full_name;
}

/// A flag for each parameter. It is set for parameters of sources in `names`; tools and payloads
/// must also be in `batch`.
std::vector<bool> parameters_of(const PhysicalModel& model, const std::vector<std::string>& names,
                                const MeasurementBatch& batch) {
  std::set<std::string> tools, payloads;
  for (const Measurement& m : batch.measurements) {
    tools.insert(m.context.tool);
    payloads.insert(m.context.payload);
  }
  std::vector<bool> chosen;
  for (const ErrorSourcePtr& source : model.sources) {
    const std::size_t count = source->parameters().size();
    const std::vector<std::string> ids = owners(*source, *model.cell);
    for (std::size_t k = 0; k < count; ++k) {
      const bool here = ids.empty() || (source->cause().part == Part::kTool ? tools : payloads)
                                           .contains(ids[k * ids.size() / count]);
      chosen.push_back(here && contains(names, source->name()));
    }
  }
  return chosen;
}

/// Adds how the new values depend on the poses and on the rest, to first order about the solution.
void add_dependence(Refit& refit, const CalibrationProblem& problem) {
  const CalibrationResult& found = refit.result;
  const std::vector<bool> none_held(static_cast<std::size_t>(found.model.values.size()), false);
  const ScaledParameters own = scaled_parameters(found.model, none_held);
  const Expansion at =
      expand({found.model, problem.batch}, own, weights_of(found, problem.batch), true, own.prior);
  MatrixXd information = at.information(refit.anew, refit.anew);
  information.diagonal().array() += 1;
  const Eigen::LLT<MatrixXd> factor(information);
  const VectorXd scale = own.scale(refit.anew);
  const auto R = static_cast<Index>(refit.anew.size());
  refit.given_rest =
      scale.asDiagonal() * factor.solve(MatrixXd::Identity(R, R)) * scale.asDiagonal();
  refit.by_rest = -(scale.asDiagonal() * factor.solve(at.information(refit.anew, Eigen::all)) *
                    own.scale.cwiseInverse().asDiagonal());
  for (const Index k : refit.anew) refit.by_rest.col(k).setZero();
}

/// Adds the combinations of the rest that were not identifiable before.
void add_unidentifiable(CalibrationResult& result, const CalibrationResult& known,
                        const std::set<std::string>& anew) {
  std::vector<UnidentifiableCombination> rest = known.unidentifiable;
  std::erase_if(rest, [&](const UnidentifiableCombination& one) {
    return std::all_of(one.parameters.begin(), one.parameters.end(),
                       [&](const std::string& name) { return anew.contains(name); });
  });
  result.unidentifiable.insert(result.unidentifiable.end(), rest.begin(), rest.end());
}

/// Takes over from `known` all that was kept.
void keep_rest(Refit& refit, const CalibrationResult& known) {
  CalibrationResult& result = refit.result;
  const std::set<Index> anew(refit.anew.begin(), refit.anew.end());
  result.covariance = refit.carried(known.covariance);
  for (std::size_t k = 0; k < refit.place.size(); ++k) {
    const Index to = refit.place[k];
    if (anew.contains(to)) continue;
    const std::string name = result.parameters[static_cast<std::size_t>(to)].parameter.name;
    result.parameters[static_cast<std::size_t>(to)] = known.parameters[k];
    result.parameters[static_cast<std::size_t>(to)].parameter.name = name;
  }
  std::set<std::string> names;
  for (const Index k : refit.anew) {
    IdentifiedParameter& parameter = result.parameters[static_cast<std::size_t>(k)];
    parameter.stddev = std::sqrt(result.covariance(k, k));
    names.insert(parameter.parameter.name);
  }
  add_unidentifiable(result, known, names);
  result.rank =
      static_cast<int>(result.parameters.size()) - static_cast<int>(result.unidentifiable.size());
  result.condition_number = known.condition_number;
  result.observability_index = known.observability_index;
}

}  // namespace

MatrixXd Refit::carried(const MatrixXd& before) const {
  const auto P = static_cast<Index>(result.parameters.size());
  MatrixXd now = MatrixXd::Zero(P, P);
  now.diagonal() = prior_variance;
  now(place, place) = before;
  for (const Index k : anew) {
    now.row(k).setZero();
    now.col(k).setZero();
  }
  const MatrixXd across = by_rest * now;
  now(anew, Eigen::all) = across;
  now(Eigen::all, anew) = across.transpose();
  now(anew, anew) = given_rest + across * by_rest.transpose();
  return now;
}

Result<PhysicalModel> in_cell(const PhysicalModel& model, const std::shared_ptr<const Cell>& cell,
                              std::vector<Index>* place) {
  TRY(check_has_all(model, *cell));
  PhysicalModel moved = model;
  moved.cell = cell;
  for (const auto& [id, X_FT] : cell->tools)
    moved.tools.emplace(id, X_FT.value_or(Pose::Identity()));
  std::vector<Index> went;
  Index first = 0;
  for (ErrorSourcePtr& source : moved.sources) {
    ErrorSourcePtr same = TRY(make_error_source(source->name(), *cell));
    for (const Index k : places(*source, *model.cell, *same, *cell)) went.push_back(first + k);
    first += static_cast<Index>(same->parameters().size());
    source = std::move(same);
  }
  moved.values = moved.prior_values();
  moved.values(went) = model.values;
  if (place != nullptr) *place = std::move(went);
  return moved;
}

namespace {

/// The parameters to identify anew, and where they start.
struct Anew {
  std::vector<std::string> sources;  ///< full names
  std::vector<bool> parameters;      ///< a flag each
};

/// Frees the sources in `only`, adds those that the model lacks, and sets their parameters to the
/// priors. `refit` gets the indices and prior variances.
Result<Anew> begin_anew(CalibrationProblem& problem, const std::vector<std::string>& only,
                        Refit& refit) {
  Anew anew;
  for (const std::string& name : only) {
    std::string source = TRY(named_source(problem.model, name, refit.place));
    anew.sources.push_back(std::move(source));
  }
  TRY(check_needs(problem));
  anew.parameters = parameters_of(problem.model, anew.sources, problem.batch);
  const std::vector<Parameter> parameters = problem.model.parameters();
  refit.prior_variance = VectorXd::Zero(static_cast<Index>(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const auto at = static_cast<Index>(k);
    refit.prior_variance(at) = std::pow(parameters[k].prior_scale, 2);
    if (anew.parameters[k]) refit.anew.push_back(at);
  }
  return anew;
}

/// Places new bases and tools by the poses and the known arm, as the start; all else starts at its
/// prior.
Status place_anew(CalibrationProblem& problem, const Anew& anew, const Refit& refit) {
  const PhysicalModel before = problem.model;
  const std::vector<Parameter> parameters = problem.model.parameters();
  for (const Index at : refit.anew)
    problem.model.values(at) = parameters[static_cast<std::size_t>(at)].prior;
  const bool base = corrects(anew.sources, Part::kBase);
  const bool tool = corrects(anew.sources, Part::kTool);
  for (const Measurement& m : problem.batch.measurements) {
    const auto& X_FT = problem.model.cell->tools.at(m.context.tool);
    if (tool && X_FT) problem.model.tools[m.context.tool] = *X_FT;
  }
  const Status located = locate_refitted_frames(before, problem.batch, base, tool, problem.model);
  if (!located) return Failure(located.error()).in("batch " + problem.batch.id);
  return {};
}

}  // namespace

Result<Refit> refit(const CalibrationResult& known, const std::shared_ptr<const Cell>& cell,
                    const MeasurementBatch& batch, const std::vector<std::string>& only,
                    CalibrateOptions options) {
  if (batch.measurements.empty())
    return refused("no measurements to calibrate with").in("batch " + batch.id).beyond(0, 1);
  if (only.empty())
    return failure(ErrorCode::kUsage, "no error source is named to be identified anew");
  Refit refit;
  PhysicalModel model = TRY(in_cell(known.model, cell, &refit.place));
  CalibrationProblem problem{std::move(model), batch};
  const Anew anew = TRY(begin_anew(problem, only, refit));
  TRY(place_anew(problem, anew, refit));
  for (const bool one : anew.parameters) options.held.push_back(!one);
  CalibrationResult found = TRY(identify(problem, options));
  refit.result = std::move(found);
  for (std::size_t k = 0; k < anew.parameters.size(); ++k) {
    if (!anew.parameters[k])
      refit.result.model.values(static_cast<Index>(k)) =
          problem.model.values(static_cast<Index>(k));
  }
  add_dependence(refit, problem);
  keep_rest(refit, known);
  return refit;
}

}  // namespace trammel
