// Batch triage. The model: a measured position differs from what the model in force predicts by
//
//   r_i = J_i delta + A_i theta + e_i,    delta ~ N(0, C),    e_i ~ N(0, S_i),
//
// with delta what calibration left uncertain of the model's own parameters (C is its posterior covariance), S_i the
// variance that the model expects of this very pose (measurement, learned bias, discrepancy; not below what its own
// held-out poses showed), and theta what one alternative sets free: six numbers of the base, six of the tool, four of
// the payload, one zero of a joint, or all that the model knows of the arm. Every alternative is fitted in full (the
// sources' exact derivatives, Gauss-Newton) and scored by
//
//   sum_i min(|S_i^-1/2 r_i|^2, c) + delta' C^-1 delta + k log(3 n),    c = 3 log(3 n) + 2 log n:
//
// minus twice the log likelihood with Schwarz's price for the k directions of theta that the poses show. A pose that
// costs more than c is cheaper as one with three free numbers of its own: a single bad pose, chosen among n.
//
// Whether an alternative *explains* the batch is asked of its inliers' chi^2, not of its rank among alternatives; among
// those that explain it the lowest score wins, and whatever comes within kDoubt of it could be it as well. Simple
// stories come first: one cause; then one cause while the tracker stands elsewhere, as it does whenever it was set up
// again; then one cause that begins in the middle of the batch.
//
// What is identifiable: a turned base is a slipped joint 1 (both turn about its axis), a shifted tool is the last link;
// the payload shows through compliance only and is no alternative where the model has none. Only positions are used:
// orientations would tell a tool that is turned about its own point, which does not matter to positions.
#include "server/diagnose/triage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "server/base/units.h"
#include "server/error_sources/physical_model.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

constexpr std::size_t kFewestPoses = 8;
constexpr int kMostIterations = 30;
constexpr double kDone = 1e-4;         // last step, in units of the parameters' own scales
constexpr double kFarthest = 9;        // times the median of |residual|^2: annealing towards the final limit
constexpr double kGoodMisfit = 2.25;   // chi^2 per degree of freedom: 1.5 times the expected deviation is still good
constexpr double kMostOutliers = 0.1;  // of the poses
constexpr int kFewOutliers = 2;        // more than these may be a step
constexpr double kDoubt = 10;          // of scores: odds of e^5
constexpr double kWeakPrior = 1e-8;    // of what an alternative sets free, per squared scale of the parameter
constexpr int kStepGrid = 12;          // places of a batch at which something may have begun, then refined
const std::set<std::string> kNotTheArm = {"base",          "tool",       "payload",      "tracker_moved",
                                          "tracker_drift", "joint_slip", "tool_changed", "payload_changed",
                                          "time_lag"};

std::string cause_of(const ErrorSource& source) {
  const std::string name = source.name();
  return name.substr(0, name.find_first_of(":@"));
}

/// An explanation: which parameters of which model are free, from which pose on.
struct Alternative {
  Cause cause;  ///< `cause` empty: none
  bool harmful = false;
  bool tracker_elsewhere = false;
  int first = 0;
  PhysicalModel model;
  std::vector<bool> free;  ///< of the model's parameters: by this alternative, from pose `first` on
  std::vector<bool> base;  ///< by the tracker, at all poses
  Eigen::VectorXd known;   ///< values to start from
};

struct Fit {
  double score = 0;
  double misfit = 0;  ///< chi^2 per degree of freedom of the inliers
  bool explains = false;
  std::vector<int> outliers;
  Eigen::Matrix3Xd residual;  ///< m
};

/// The batch against one model: what the alternatives share.
class Comparison {
 public:
  Comparison(const CompensatedModel& model, const MeasurementBatch& batch) : model_(model), batch_(batch) {
    const CompensatedModel::LevelErrors errors = model.errors_B(batch);
    bias_B_ = errors.calibrated - errors.compensated;
    deviation_ = errors.stddev;
    const double expected = std::sqrt(deviation_.squaredNorm() / static_cast<double>(poses()));
    if (const auto& held_out = model.parts().validation) {
      deviation_ *= std::max(1.0, held_out->compensated.rms / expected);
    }
    for (const Measurement& m : batch.measurements) contexts_.push_back(as_served(m));
  }

  [[nodiscard]] int poses() const { return static_cast<int>(batch_.measurements.size()); }
  [[nodiscard]] const MeasurementBatch& batch() const { return batch_; }
  [[nodiscard]] const CompensatedModel& model() const { return model_; }

  [[nodiscard]] Fit fit(const Alternative& alternative) const;
  /// Where the base would have to stand for the batch as it is; where it stands in `model` when that cannot be told.
  [[nodiscard]] Pose located_base(const PhysicalModel& model) const;

 private:
  [[nodiscard]] PoseContext as_served(const Measurement& m) const {
    PoseContext context = m.context;
    context.served = true;
    if (!context.temperature) context.temperature = model_.parts().temperature_mean;
    return context;
  }
  /// Measured - predicted, and minus its derivative.
  void residual(const Alternative& alternative, const Eigen::VectorXd& values, int pose, Vector3& r,
                Eigen::MatrixXd& jacobian) const;
  [[nodiscard]] Eigen::MatrixXd prior_precision(const Alternative& alternative, const Eigen::VectorXd& scale) const;

  const CompensatedModel& model_;
  const MeasurementBatch& batch_;
  Eigen::Matrix3Xd bias_B_, deviation_;  // m
  std::vector<PoseContext> contexts_;
};

void Comparison::residual(const Alternative& alternative, const Eigen::VectorXd& values, int pose, Vector3& r,
                          Eigen::MatrixXd& jacobian) const {
  Eigen::VectorXd here = values;
  const bool begun = pose >= alternative.first;
  for (Eigen::Index k = 0; !begun && k < here.size(); ++k) {
    if (alternative.free[static_cast<std::size_t>(k)]) here(k) = alternative.known(k);
  }
  const Pose X_WT = alternative.model.pose_W(contexts_[static_cast<std::size_t>(pose)], here, &jacobian);
  const Matrix3 R_BW = alternative.model.X_WB.linear().transpose();
  r = R_BW * (batch_.measurements[static_cast<std::size_t>(pose)].p_W - X_WT.translation()) - bias_B_.col(pose);
  jacobian = (R_BW * jacobian.topRows<3>()).eval();
  for (Eigen::Index k = 0; !begun && k < here.size(); ++k) {
    if (alternative.free[static_cast<std::size_t>(k)]) jacobian.col(k).setZero();
  }
}

/// Of all parameters in units of their scales: the model's own as calibration left them, those set free hardly any.
Eigen::MatrixXd Comparison::prior_precision(const Alternative& alternative, const Eigen::VectorXd& scale) const {
  constexpr double kRounding = 1e-10;  // a covariance may be flat: what is known for certain
  const Eigen::Index p = scale.size();
  std::vector<Eigen::Index> held, held_in_model;
  std::map<std::string, Eigen::Index> place;  // of the calibrated model's parameters
  const std::vector<Parameter> own = model_.parts().physics.parameters();
  for (std::size_t k = 0; k < own.size(); ++k) place[own[k].name] = static_cast<Eigen::Index>(k);
  const std::vector<Parameter> all = alternative.model.parameters();
  for (Eigen::Index k = 0; k < p; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const auto found = place.find(all[at].name);
    if (alternative.free[at] || alternative.base[at] || found == place.end()) continue;
    held.push_back(k);
    held_in_model.push_back(found->second);
  }
  Eigen::MatrixXd precision = kWeakPrior * Eigen::MatrixXd::Identity(p, p);
  if (held.empty()) return precision;
  Eigen::MatrixXd covariance = model_.parts().covariance(held_in_model, held_in_model);
  const Eigen::VectorXd inverse = scale(held).cwiseInverse();
  covariance = inverse.asDiagonal() * covariance * inverse.asDiagonal();
  covariance.diagonal().array() += kRounding;
  const Eigen::MatrixXd known = covariance.llt().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
  precision(held, held) = known;
  return precision;
}

Pose Comparison::located_base(const PhysicalModel& model) const {
  Eigen::Matrix3Xd measured_W(3, poses()), predicted_B(3, poses());
  for (int i = 0; i < poses(); ++i) {
    measured_W.col(i) = batch_.measurements[static_cast<std::size_t>(i)].p_W;
    const Pose X_WT = model.pose_W(contexts_[static_cast<std::size_t>(i)]);
    predicted_B.col(i) = model.X_WB.inverse() * X_WT.translation() + bias_B_.col(i);
  }
  return fit_transform(measured_W, predicted_B).value_or(model.X_WB);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Directions of the free parameters that the poses show: more of them than the prior does.
int shown_directions(const Alternative& alternative, const Eigen::MatrixXd& information) {
  std::vector<Eigen::Index> free;
  for (std::size_t k = 0; k < alternative.free.size(); ++k) {
    if (alternative.free[k] || alternative.base[k]) free.push_back(static_cast<Eigen::Index>(k));
  }
  if (free.empty()) return 0;
  const Eigen::MatrixXd own = information(free, free);
  const Eigen::VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(own).eigenvalues();
  return static_cast<int>((eigenvalues.array() > 1).count());
}

Fit Comparison::fit(const Alternative& alternative) const {
  const int n = poses();
  const double price = std::log(3.0 * n);
  const double limit = 3 * price + 2 * std::log(static_cast<double>(n));
  const std::vector<Parameter> parameters = alternative.model.parameters();
  const auto p = static_cast<Eigen::Index>(parameters.size());
  Eigen::VectorXd scale(p);
  for (Eigen::Index k = 0; k < p; ++k) scale(k) = parameters[static_cast<std::size_t>(k)].prior_scale;
  const Eigen::MatrixXd precision = prior_precision(alternative, scale);

  Fit fit;
  fit.residual.resize(3, n);
  Eigen::VectorXd values = alternative.known;
  Eigen::MatrixXd information(p, p), jacobian;
  Eigen::VectorXd gradient(p);
  std::vector<double> square(static_cast<std::size_t>(n));
  std::vector<Eigen::MatrixXd> rows(static_cast<std::size_t>(n));
  double prior_cost = 0;
  for (int iteration = 0;; ++iteration) {
    for (int i = 0; i < n; ++i) {
      const auto at = static_cast<std::size_t>(i);
      Vector3 r;
      residual(alternative, values, i, r, jacobian);
      fit.residual.col(i) = r;
      rows[at] = deviation_.col(i).cwiseInverse().asDiagonal() * jacobian * scale.asDiagonal();
      square[at] = r.cwiseQuotient(deviation_.col(i)).squaredNorm();
    }
    // First all poses, so that what has begun is followed; then only those that are not much farther off than others.
    const double farthest =
        iteration == 0 ? std::numeric_limits<double>::infinity()
                       : std::max(limit, kFarthest * median({square.begin() + alternative.first, square.end()}));
    const Eigen::VectorXd off = (values - alternative.known).cwiseQuotient(scale);
    prior_cost = off.dot(precision * off);
    information.setZero();
    gradient = -precision * off;
    for (int i = 0; i < n; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (square[at] > farthest) continue;
      information.noalias() += rows[at].transpose() * rows[at];
      gradient.noalias() += rows[at].transpose() * fit.residual.col(i).cwiseQuotient(deviation_.col(i));
    }
    const Eigen::VectorXd step = (information + precision).ldlt().solve(gradient);
    if (iteration >= kMostIterations || !(step.norm() > kDone)) break;
    values += step.cwiseProduct(scale);
  }

  double inside = 0;
  for (int i = 0; i < n; ++i) {
    const double cost = square[static_cast<std::size_t>(i)];
    if (cost > limit)
      fit.outliers.push_back(i);
    else
      inside += cost;
  }
  const int k = shown_directions(alternative, information);
  const int freedom = 3 * (n - static_cast<int>(fit.outliers.size())) - k;
  const int steps = alternative.first > 0 ? 2 : 0;  // where it begins was chosen
  fit.score = inside + limit * static_cast<double>(fit.outliers.size()) + prior_cost + k * price +
              steps * std::log(static_cast<double>(n));
  fit.misfit = freedom > 0 ? inside / freedom : inside;
  const double most = std::max<double>(kFewOutliers, kMostOutliers * n);
  fit.explains = freedom > 0 && fit.misfit <= kGoodMisfit && static_cast<double>(fit.outliers.size()) <= most;
  return fit;
}

/// The alternatives that this model and batch allow.
class Alternatives {
 public:
  explicit Alternatives(const Comparison& comparison)
      : physics_(comparison.model().parts().physics), X_WB_(comparison.located_base(physics_)) {}

  [[nodiscard]] Alternative none() const { return started({}, physics_); }
  /// One cause each, from pose `first` (0: the whole batch) on.
  [[nodiscard]] std::vector<Alternative> from(int first, const std::string& pose_id) const {
    std::vector<Alternative> all;
    const auto add = [&](const Cause& cause, const std::string& spec, bool harmful) {
      Alternative one = started(cause, physics_);
      if (!set_free(one, spec, one.free)) return;
      one.cause.pose_id = pose_id;
      one.first = first;
      one.harmful = harmful || first > 0;
      if (cause.cause == "tracker_moved" && first == 0) one.model.X_WB = X_WB_;
      all.push_back(std::move(one));
    };
    add({"tracker_moved", -1, "", "", {}}, "base", false);
    add({"tool_changed", -1, "", "", {}}, "tool", true);
    if (carries()) add({"payload_changed", -1, "", "", {}}, "payload", true);
    for (int joint = 0; joint < physics_.cell->robot.size(); ++joint) {
      add({"joint_slip", joint, "", "", {}}, fmt::format("joint_slip:{}@1", joint + 1), false);
    }
    if (first == 0) add_drift(all);
    return all;
  }
  /// The same while the tracker stands elsewhere.
  [[nodiscard]] std::vector<Alternative> with_the_tracker() const {
    std::vector<Alternative> all = from(0, "");
    std::erase_if(all, [](const Alternative& one) { return one.cause.cause == "tracker_moved"; });
    for (Alternative& one : all) {
      one.tracker_elsewhere = set_free(one, "base", one.base);
      one.model.X_WB = X_WB_;
    }
    return all;
  }

 private:
  static Alternative started(const Cause& cause, const PhysicalModel& model) {
    Alternative one;
    one.cause = cause;
    one.model = model;
    one.known = model.values;
    one.free.assign(static_cast<std::size_t>(model.values.size()), false);
    one.base = one.free;
    return one;
  }
  /// Frees the source that `spec` names in `set`, which it is added for where the model has none.
  static bool set_free(Alternative& one, const std::string& spec, std::vector<bool>& set) {
    Eigen::Index first = 0;
    for (const ErrorSourcePtr& source : one.model.sources) {
      const auto count = static_cast<Eigen::Index>(source->parameters().size());
      if (source->name() == spec) {
        std::fill_n(set.begin() + first, count, true);
        return true;
      }
      first += count;
    }
    auto added = make_error_source(spec, *one.model.cell);
    if (!added) return false;
    const auto count = static_cast<Eigen::Index>((*added)->parameters().size());
    const Eigen::Index at = add_source(one.model, std::move(*added));
    one.known = one.model.values;
    one.free.insert(one.free.begin() + at, static_cast<std::size_t>(count), false);
    one.base.insert(one.base.begin() + at, static_cast<std::size_t>(count), false);
    std::fill_n(set.begin() + at, count, true);
    return true;
  }
  /// Whether the model lets a payload show.
  [[nodiscard]] bool carries() const {
    return !physics_.cell->payloads.empty() &&
           std::any_of(physics_.sources.begin(), physics_.sources.end(), [](const ErrorSourcePtr& source) {
             const std::string cause = cause_of(*source);
             return cause.starts_with("compliance") || cause == "link_bending";
           });
  }
  void add_drift(std::vector<Alternative>& all) const {
    Alternative one = started({"drift", -1, "", "", {}}, physics_);
    Eigen::Index first = 0;
    bool any = false;
    for (const ErrorSourcePtr& source : physics_.sources) {
      const auto count = static_cast<Eigen::Index>(source->parameters().size());
      if (!kNotTheArm.contains(cause_of(*source))) {
        std::fill_n(one.free.begin() + first, count, true);
        any = true;
      }
      first += count;
    }
    if (any) all.push_back(std::move(one));
  }

  const PhysicalModel& physics_;
  const Pose X_WB_;
};

/// What has been tried, the best first.
struct Tried {
  Alternative alternative;
  Fit fit;
};

class Judge {
 public:
  Judge(const Comparison& comparison, const Alternatives& alternatives)
      : comparison_(comparison), alternatives_(alternatives) {}

  Triage verdict() {
    const Tried none{alternatives_.none(), comparison_.fit(alternatives_.none())};
    const bool as_expected = none.fit.explains;
    if (!(as_expected && none.fit.outliers.size() <= static_cast<std::size_t>(kFewOutliers))) {
      if (as_expected) tried_.push_back(none);
      try_all(alternatives_.from(0, ""));
      if (tried_.empty()) try_all(alternatives_.with_the_tracker());
      if (tried_.empty() || !tried_.front().fit.outliers.empty()) try_steps();
    } else {
      tried_.push_back(none);
    }
    return told(none);
  }

 private:
  void keep(Tried one) {
    if (!one.fit.explains) return;
    tried_.push_back(std::move(one));
    std::stable_sort(tried_.begin(), tried_.end(),
                     [](const Tried& a, const Tried& b) { return a.fit.score < b.fit.score; });
  }
  void try_all(std::vector<Alternative> alternatives) {
    for (Alternative& one : alternatives) {
      Fit fit = comparison_.fit(one);
      keep({std::move(one), std::move(fit)});
    }
  }
  /// Causes that begin at a pose: where on a grid they fit best, then nearer.
  void try_steps() {
    const int n = comparison_.poses();
    const std::size_t kinds = alternatives_.from(1, "").size();
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      const auto at = [&](int first) { return std::move(alternatives_.from(first, pose_id(first))[kind]); };
      const auto score = [&](int first) { return comparison_.fit(at(first)).score; };
      int best = 0;
      double least = 0;
      for (int k = 1; k < kStepGrid; ++k) {
        const int first = k * n / kStepGrid;
        if (first < 1) continue;
        const double here = score(first);
        if (best == 0 || here < least) best = first, least = here;
      }
      for (int width = n / kStepGrid; best > 0 && width > 0; width /= 2) {
        for (const int first : {best - width, best + width}) {
          if (first < 1 || first >= n) continue;
          const double here = score(first);
          if (here < least) best = first, least = here;
        }
      }
      if (best > 0) keep({at(best), comparison_.fit(at(best))});
    }
  }
  [[nodiscard]] std::string pose_id(int pose) const {
    return comparison_.batch().measurements[static_cast<std::size_t>(pose)].pose_id;
  }

  [[nodiscard]] Triage told(const Tried& none) const;
  [[nodiscard]] std::string sentence(const Triage& triage) const;

  const Comparison& comparison_;
  const Alternatives& alternatives_;
  std::vector<Tried> tried_;  // that explain the batch
};

Triage Judge::told(const Tried& none) const {
  Triage triage;
  triage.misfit = std::sqrt(none.fit.misfit);
  if (tried_.empty()) {
    triage.verdict = TriageVerdict::kPoisoned;
    triage.learn = false;
    triage.misfit_after = triage.misfit;
    triage.effect_rms = std::sqrt(none.fit.residual.squaredNorm() / comparison_.poses());
  } else {
    const Tried& best = tried_.front();
    for (const int pose : best.fit.outliers) triage.outliers.push_back(pose_id(pose));
    triage.misfit_after = std::sqrt(best.fit.misfit);
    triage.cause = best.alternative.cause;
    triage.tracker_elsewhere = best.alternative.tracker_elsewhere;
    triage.learn = !best.alternative.harmful;
    triage.effect_rms = std::sqrt((none.fit.residual - best.fit.residual).squaredNorm() / comparison_.poses());
    for (std::size_t k = 1; k < tried_.size(); ++k) {
      if (tried_[k].fit.score > best.fit.score + kDoubt || tried_[k].alternative.cause.cause.empty()) continue;
      triage.could_also_be.push_back(tried_[k].alternative.cause);
      triage.learn = triage.learn && !tried_[k].alternative.harmful;
    }
    if (triage.cause.cause.empty() && !triage.outliers.empty()) {
      triage.cause = {"outlier", -1, "", triage.outliers.front(), {}};
    }
    triage.verdict = triage.cause.cause.empty() ? TriageVerdict::kClean : TriageVerdict::kExplained;
  }
  triage.sentence = sentence(triage);
  return triage;
}

std::string in_words(const Cause& cause) {
  if (cause.cause == "tracker_moved") return "the tracker, or the robot's base, stands elsewhere";
  if (cause.cause == "tool_changed") return "the tool is another one, or sits elsewhere on the flange";
  if (cause.cause == "payload_changed") return "the payload is another one";
  if (cause.cause == "joint_slip") return fmt::format("joint {} lost its zero", cause.joint + 1);
  return "the arm itself has changed";
}

std::string Judge::sentence(const Triage& triage) const {
  const std::string bad =
      triage.outliers.empty() ? "" : fmt::format("; bad poses: {}", fmt::join(triage.outliers, ", "));
  switch (triage.verdict) {
    case TriageVerdict::kClean:
      return fmt::format("as the model in force expects it ({:.2f} of the expected deviation)", triage.misfit);
    case TriageVerdict::kPoisoned:
      return fmt::format(
          "{:.3g} mm rms off the model in force ({:.3g} times the expected deviation), and nothing known "
          "explains it",
          to_mm(triage.effect_rms), triage.misfit);
    case TriageVerdict::kExplained:
      break;
  }
  if (triage.cause.cause == "outlier") {
    return fmt::format("as the model in force expects it but for single poses: {}", fmt::join(triage.outliers, ", "));
  }
  std::string text = triage.cause.pose_id.empty() ? "" : fmt::format("from pose {} on ", triage.cause.pose_id);
  text += fmt::format("{} ({:.3g} mm rms)", in_words(triage.cause), to_mm(triage.effect_rms));
  if (triage.tracker_elsewhere) text += ", and the tracker stands elsewhere";
  for (const Cause& other : triage.could_also_be) {
    text += "; or " + (other.pose_id.empty() ? "" : fmt::format("from pose {} on ", other.pose_id)) + in_words(other);
  }
  return text + bad;
}

}  // namespace

std::string_view to_string(TriageVerdict verdict) {
  switch (verdict) {
    case TriageVerdict::kClean:
      return "clean";
    case TriageVerdict::kExplained:
      return "explained";
    case TriageVerdict::kPoisoned:
      return "poisoned";
  }
  return "poisoned";
}

Triage triage(const CompensatedModel& model, const MeasurementBatch& batch) {
  if (batch.measurements.size() < kFewestPoses) {
    Triage too_few;
    too_few.sentence =
        fmt::format("{} poses are too few to be held against the model in force", batch.measurements.size());
    return too_few;
  }
  const Comparison comparison(model, batch);
  const Alternatives alternatives(comparison);
  return Judge(comparison, alternatives).verdict();
}

}  // namespace trammel
