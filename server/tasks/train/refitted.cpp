#include "server/tasks/train/refitted.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/measurement/gauges.h"
#include "server/tasks/train/lasting_sources.h"
#include "server/tasks/train/leftover.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

constexpr double kSameFrame = 1e-6;    // m and rad: below the precision of a file
constexpr int kMostRounds = 5;         // of taking off the bias and finding the base again
constexpr double kSettledTurn = 1e-9;  // rad
constexpr double kBeyondChance = 3;    // standard deviations of chi^2

/// A frame that the cell states, and that `only` does not list, must equal the model's.
Status check_same_frame(const Cell& cell, const std::string& what, const std::optional<Pose>& said,
                        const Pose& kept, const std::string& source) {
  if (!said) return {};
  const Vector6 difference = pose_difference(*said, kept);
  if (difference.cwiseAbs().maxCoeff() <= kSameFrame) return {};
  const double shift_mm = to_mm(difference.head<3>().norm());
  const double turn_deg = to_deg(difference.tail<3>().norm());
  const bool shifted = shift_mm > to_mm(kSameFrame);
  return refused("cell {}: {} is {:.3f} mm and {:.4f} deg from that of the model to start from",
                 cell.name, what, shift_mm, turn_deg)
      .of(fmt::format("{}: {}", source, shifted ? "xyz_mm" : "q_wxyz"))
      .with_value(shifted ? shift_mm : turn_deg)
      .next(fmt::format(
          "name {} among what is refitted, or leave it in the cell file as the model has it",
          source));
}

std::vector<std::string> names_of(const CompensatedModel& model) {
  std::vector<std::string> names;
  for (const ErrorSourcePtr& source : model.parts().physics.sources)
    names.push_back(source->name());
  return names;
}

}  // namespace

Status check_may_start_from(const CompensatedModel& from, const Cell& cell,
                            const MeasurementBatch& batch, const std::vector<std::string>& only) {
  TRY(require_positions(batch, "identifying anew in a model"));
  const PhysicalModel& model = from.parts().physics;
  if (model.cell->robot_yaml != cell.robot_yaml) {
    return refused("the model to start from is of another robot than cell {}", cell.name)
        .in("batch " + batch.id);
  }
  if (!corrects(only, causes::Part::kBase)) {
    TRY(check_same_frame(cell, "its base", cell.X_WB, model.X_WB, "base"));
  }
  for (const auto& [name, kept] : model.tools) {
    const auto said = cell.tools.find(name);
    if (said == cell.tools.end() || corrects(only, causes::Part::kTool)) continue;
    const Status same =
        check_same_frame(cell, fmt::format("tool '{}'", name), said->second, kept, "tool");
    if (!same) return same;
  }
  for (const Measurement& m : batch.measurements) {
    const std::string& tool = m.context.tool;
    const bool of_model =
        std::any_of(from.parts().trained_with.begin(), from.parts().trained_with.end(),
                    [&](const auto& known) { return known.first == tool; });
    if (of_model || cell.tools.at(tool) || corrects(only, causes::Part::kTool)) continue;
    return refused("where tool '{}' sits is known to neither cell {} nor the model to start from",
                   tool, cell.name)
        .in("batch " + batch.id)
        .at_row(m.row)
        .of("tool_id")
        .with_text(tool)
        .next("name tool among what is refitted");
  }
  return {};
}

namespace {

CalibrationResult known_of(const CompensatedModel::Parts& parts) {
  CalibrationResult known;
  known.model = parts.physics;
  known.parameters = parts.parameters;
  known.covariance = parts.covariance;
  known.rank = parts.rank;
  known.unidentifiable = parts.unidentifiable;
  known.condition_number = parts.condition_number;
  known.observability_index = parts.observability_index;
  return known;
}

/// The bias at each pose, seen from the arm's true base (A), and the sigma of a measurement from
/// which the bias was subtracted.
struct BiasAt {
  std::vector<Vector3> shift_A;
  std::vector<Matrix3> turn_A;
  std::vector<double> sigma;
};

/// `parts` with all parameters treated as exact: their uncertainty is stated separately.
Result<BiasAt> bias_at(CompensatedModel::Parts parts, const MeasurementBatch& poses) {
  parts.covariance.setZero();
  if (parts.bias_origin) parts.bias_origin->covariance.setZero();
  const CompensatedModel model = TRY(CompensatedModel::make(std::move(parts)));
  const PhysicalModel& physics = model.parts().physics;
  const double tracker = physics.cell->tracker.sigma;
  const Matrix3 R_AB = served_base(physics).linear().transpose() * physics.X_WB.linear();
  std::vector<PoseContext> contexts;
  for (const Measurement& m : poses.measurements) contexts.push_back(m.context);
  const std::vector<ErrorPrediction> predictions = model.predict_all(contexts);
  BiasAt bias;
  for (std::size_t i = 0; i < contexts.size(); ++i) {
    const Pose X_BT = physics.X_WB.inverse() * physics.pose_W(contexts[i]);
    const Pose& predicted = predictions[i].X_BT_predicted;
    bias.shift_A.emplace_back(R_AB * (predicted.translation() - X_BT.translation()));
    bias.turn_A.emplace_back(R_AB * predicted.linear() * X_BT.linear().transpose() *
                             R_AB.transpose());
    const double beyond =
        std::max(0.0, predictions[i].covariance_B.trace() / 3 - tracker * tracker);
    bias.sigma.push_back(
        std::sqrt(std::pow(poses.measurements[i].sigma.value_or(tracker), 2) + beyond));
  }
  return bias;
}

/// The measurements as the physics alone would have to explain them, its base turned as `R_WA`.
MeasurementBatch without_bias(MeasurementBatch poses, const BiasAt& bias, const Matrix3& R_WA) {
  for (std::size_t i = 0; i < poses.measurements.size(); ++i) {
    Measurement& m = poses.measurements[i];
    m.p_W -= R_WA * bias.shift_A[i];
    if (m.R_WT) m.R_WT = (R_WA * bias.turn_A[i].transpose() * R_WA.transpose() * *m.R_WT).eval();
    m.sigma = bias.sigma[i];
  }
  return poses;
}

/// True if the residuals of the poses are larger than their sigmas make likely. `fitted`: the
/// number of parameters fitted to these poses.
bool is_beyond_chance(const PhysicalModel& model, const MeasurementBatch& poses,
                      std::size_t fitted) {
  const BiasProblem left = leftover(model, poses);
  const double chi2 =
      (left.residual_B.rowwise().squaredNorm().array() / left.sigma.array().square()).sum();
  const double freedom = 3.0 * static_cast<double>(left.sigma.size()) - static_cast<double>(fitted);
  return freedom > 0 && chi2 > freedom + kBeyondChance * std::sqrt(2 * freedom);
}

/// The refit taken into the model; `met` are the poses that it was found on.
Status take_over(CompensatedModel::Parts& parts, const CompensatedModel& from, const Refit& refit,
                 const MeasurementBatch& met) {
  const CalibrationResult& found = refit.result;
  parts = from.parts();
  parts.physics = found.model;
  parts.parameters = found.parameters;
  parts.covariance = found.covariance;
  parts.unidentifiable = found.unidentifiable;
  parts.rank = found.rank;
  parts.suspects = found.suspects;
  parts.cost_record = found.cost_record;
  if (is_beyond_chance(found.model, met, refit.anew.size()))
    parts.discrepancy = std::hypot(parts.discrepancy, found.discrepancy);
  for (const Measurement& m : met.measurements)
    parts.trained_with.emplace(m.context.tool, m.context.payload);
  if (!parts.bias) return {};
  PhysicalModel learned = TRY(in_cell(from.learned_physics().whole(), found.model.cell));
  const auto before = static_cast<Index>(from.parts().parameters.size());
  const MatrixXd since =
      parts.bias_origin ? parts.bias_origin->covariance : MatrixXd::Zero(before, before);
  parts.bias_origin = CompensatedModel::Parts::BiasOrigin{std::move(learned), refit.carried(since)};
  return {};
}

/// `own`: the model now has sources that began during this batch, so it belongs to the batch.
void record(CompensatedModel::Parts& parts, const CompensatedModel& from, const CheckedBatch& batch,
            const MeasurementBatch& trained, const std::vector<std::string>& only, bool own) {
  ModelProvenance& provenance = parts.provenance;
  provenance.level.clear();
  for (const ErrorSourcePtr& source : parts.physics.sources)
    provenance.level += (provenance.level.empty() ? "" : ",") + source->name();
  const auto poses = static_cast<int>(trained.measurements.size());
  provenance.refits.push_back({from.provenance().id, only, batch.id(), batch.hash(), poses});
  if (!own) return;
  provenance.batch_id = batch.id();
  provenance.batch_hash = batch.hash();
  provenance.training_poses = poses;
}

/// The poses as the sources see them: as poses of another batch if they are not the model's own,
/// and with a sigma no smaller than the residual of the model.
MeasurementBatch as_met(const CompensatedModel& from, const Cell& cell, MeasurementBatch poses,
                        bool own) {
  for (Measurement& m : poses.measurements) {
    m.context.served = !own;
    m.sigma = std::hypot(m.sigma.value_or(cell.tracker.sigma),
                         from.bias() ? 0.0 : from.parts().discrepancy);
  }
  return poses;
}

/// Refits. If the model has a bias, it subtracts the bias and refits until the base no longer
/// turns. Fills `parts`.
Result<Refit> refit_beside_bias(CompensatedModel::Parts& parts, const CompensatedModel& from,
                                const std::shared_ptr<const Cell>& cell,
                                const MeasurementBatch& poses,
                                const std::vector<std::string>& only) {
  const CalibrationResult known = known_of(from.parts());
  MeasurementBatch met = poses;
  std::optional<BiasAt> bias;
  Matrix3 R_WA = Matrix3::Identity();
  for (int round = 0;; ++round) {
    Result<Refit> found = refit(known, cell, met, only);
    if (!found) return found;
    const Matrix3 R_WA_now = served_base(found->result.model).linear();
    const bool settled = bias && rotation_log(R_WA_now * R_WA.transpose()).norm() < kSettledTurn;
    const bool last = !from.bias() || settled || round == kMostRounds;
    if (last || !bias) {
      TRY(take_over(parts, from, *found, met));
    }
    if (last) return found;
    if (!bias) {
      BiasAt learned = TRY(bias_at(parts, poses));
      bias = std::move(learned);
    }
    R_WA = R_WA_now;
    met = without_bias(poses, *bias, R_WA);
  }
}

}  // namespace

Result<Refitted> refitted(const CompensatedModel& from, const std::shared_ptr<const Cell>& cell,
                          const CheckedBatch& batch, const MeasurementBatch& trained,
                          const std::vector<std::string>& only) {
  TRY(check_may_start_from(from, *cell, trained, only));
  const bool of_this_batch = lasting_sources(only) != only;
  const std::vector<std::string> sources = names_of(from);
  const bool is_its_own = batch.hash() == from.provenance().batch_hash;
  if (of_this_batch && !is_its_own && lasting_sources(sources) != sources) {
    return refused(
               "the model to start from has sources that began during batch {}: none that began "
               "during this one can be added",
               from.provenance().batch_id)
        .in("batch " + batch.id());
  }
  Refitted result;
  result.poses = as_met(from, *cell, trained, of_this_batch || is_its_own);
  Refit found = TRY(refit_beside_bias(result.parts, from, cell, result.poses, only));
  record(result.parts, from, batch, trained, only, of_this_batch);
  for (std::size_t i = 0; i < trained.measurements.size(); ++i)
    result.poses.measurements[i].sigma = trained.measurements[i].sigma;
  result.found = std::move(found.result);
  result.found.covariance.setZero();
  result.found.covariance(found.anew, found.anew) = found.given_rest;
  return result;
}

Cell with_known_tools(Cell cell, const CompensatedModel& from,
                      const std::vector<std::string>& only) {
  if (corrects(only, causes::Part::kTool)) return cell;
  for (const auto& [name, payload] : from.parts().trained_with) {
    const auto tool = cell.tools.find(name);
    if (tool != cell.tools.end() && !tool->second)
      tool->second = served_tool(from.parts().physics, name);
  }
  return cell;
}

}  // namespace trammel
