#include "server/report/model_poses.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/compensate/accuracy.h"
#include "server/report/html.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t kMostListed = 1000;  // poses in the table
constexpr int kBinsPerDecade = 3;
constexpr double kLeastShown = 1e-3;         // mm: a smaller error stands in the first bin
constexpr std::size_t kFewestToJudge = 8;    // poses
constexpr Eigen::Index kFewestToLearn = 40;  // poses of a learning curve
constexpr Eigen::Index kMostToLearn = 600;
constexpr Eigen::Index kMostCoupled = 250;  // poses of a bias whose axes are learned together
constexpr double kWorthIt = 0.1;            // relative gain

ShownPoses poses_of(const CompensatedModel& model, const MeasurementBatch& batch) {
  ShownPoses shown{fmt::format("poses of batch {}", batch.id), {}};
  const CompensatedModel::LevelErrors errors = model.errors_B(batch);
  for (Eigen::Index i = 0; i < errors.compensated.cols(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    const Measurement& m = batch.measurements[row];
    shown.poses.push_back({m.pose_id, m.context.q, m.context, Vector3(errors.nominal.col(i)),
                           errors.calibrated.col(i), errors.compensated.col(i),
                           errors.stddev.col(i), errors.in_domain[row]});
  }
  return shown;
}

/// The tool and payload of observation `i`, if the file has them.
std::optional<PoseContext> context_of(const ModelParts& parts, std::size_t i,
                                      const JointVector& q) {
  PoseContext context;
  if (i < parts.bias_contexts.size()) {
    context = parts.bias_contexts[i];
  } else if (parts.trained_with.size() == 1) {
    std::tie(context.tool, context.payload) = *parts.trained_with.begin();
  } else {
    return std::nullopt;
  }
  context.q = q;
  return context;
}

ShownPoses poses_learned(const CompensatedModel& model, const BiasModel& bias) {
  ShownPoses shown{"training poses, counted without those held out, each left out of the bias", {}};
  const ModelParts& parts = model.parts();
  const BiasState& state = bias.state();
  const Eigen::MatrixXd left = state.residual_B - bias.leave_one_out_mean_B();
  const Eigen::MatrixXd stddev = bias.leave_one_out_stddev_B();
  const Pose X_BW = parts.physics.X_WB.inverse();
  for (Eigen::Index i = 0; i < left.rows(); ++i) {
    ShownPose pose{.id = fmt::format("training pose {}", i + 1),
                   .q = state.q.row(i).transpose(),
                   .context = {},
                   .nominal = {}};
    pose.context = context_of(parts, static_cast<std::size_t>(i), pose.q);
    pose.calibrated = state.residual_B.row(i).transpose();
    pose.compensated = left.row(i).transpose();
    pose.stddev = stddev.row(i).transpose();
    if (pose.context && !parts.bias_origin) {
      const PhysicalModel& physics = parts.physics;
      pose.nominal = pose.calibrated + (X_BW * physics.pose_W(*pose.context)).translation() -
                     (X_BW * physics.nominal_pose_W(*pose.context)).translation();
    }
    shown.poses.push_back(std::move(pose));
  }
  return shown;
}

int bin_of(const Vector3& error) {
  return static_cast<int>(
      std::floor(kBinsPerDecade * std::log10(std::max(to_mm(error.norm()), kLeastShown)) + 1e-9));
}

double lower_end(int bin) { return std::pow(10, static_cast<double>(bin) / kBinsPerDecade); }

/// The errors of one level; poses without it are left out.
std::vector<Vector3> errors_at(const ShownPoses& shown, int level) {
  std::vector<Vector3> errors;
  for (const ShownPose& pose : shown.poses) {
    if (level == 0 && !pose.nominal) continue;
    errors.push_back(level == 0 ? *pose.nominal : level == 1 ? pose.calibrated : pose.compensated);
  }
  return errors;
}

std::vector<int> counted(const std::vector<Vector3>& errors, int first, int last) {
  std::vector<int> counts(static_cast<std::size_t>(last - first + 1), 0);
  for (const Vector3& error : errors) ++counts[static_cast<std::size_t>(bin_of(error) - first)];
  return counts;
}

/// rms at left-out poses under the bias of the other poses. `poses`: the number of these others.
struct LeftOut {
  int poses = 0;
  double rms = 0;
};

std::optional<LeftOut> left_out(const BiasModel& bias, int keep, int of) {
  const BiasState& state = bias.state();
  std::vector<Eigen::Index> out;
  for (Eigen::Index i = 0; i < state.q.rows(); ++i)
    if (i % of >= keep) out.push_back(i);
  const Result<BiasModel> part = bias.without(out);
  if (!part) return std::nullopt;
  Eigen::MatrixXd q(static_cast<Eigen::Index>(out.size()), state.q.cols());
  std::vector<BiasFeatures> features;
  for (std::size_t k = 0; k < out.size(); ++k) {
    q.row(static_cast<Eigen::Index>(k)) = state.q.row(out[k]);
    if (bias.needs_features()) features.push_back(state.features[static_cast<std::size_t>(out[k])]);
  }
  const Eigen::MatrixXd mean = part->mean_all_B(q, features);
  double squares = 0;
  for (std::size_t k = 0; k < out.size(); ++k)
    squares +=
        (state.residual_B.row(out[k]) - mean.row(static_cast<Eigen::Index>(k))).squaredNorm();
  return LeftOut{static_cast<int>(state.q.rows()) - static_cast<int>(out.size()),
                 std::sqrt(squares / static_cast<double>(out.size()))};
}

std::string worth(double fewer, double more) {
  return more > (1 - kWorthIt) * fewer ? "more poses would help little" : "more poses would help";
}

std::optional<LearningCurve> curve_of_bias(const BiasModel& bias) {
  const Eigen::Index count = bias.state().q.rows();
  if (count < kFewestToLearn || count > (bias.needs_features() ? kMostCoupled : kMostToLearn))
    return std::nullopt;
  LearningCurve curve{"error at poses left out, instrument included, mm rms", ""};
  for (const int keep : {1, 2, 3}) {
    const auto part = left_out(bias, keep, 4);
    if (!part) continue;
    curve.poses.push_back(part->poses);
    curve.error.push_back(part->rms);
  }
  const Eigen::MatrixXd left = bias.state().residual_B - bias.leave_one_out_mean_B();
  curve.poses.push_back(static_cast<int>(count));
  curve.error.push_back(std::sqrt(left.squaredNorm() / static_cast<double>(count)));
  const std::size_t half = curve.error.size() < 4 ? 0 : 1;
  curve.sentence = fmt::format(
      "From {} to {} poses the error at poses left out went from {:.4f} to {:.4f} mm: {}.",
      curve.poses[half], curve.poses.back(), to_mm(curve.error[half]), to_mm(curve.error.back()),
      worth(curve.error[half], curve.error.back()));
  return curve;
}

std::optional<LearningCurve> curve_of_parameters(const CompensatedModel& model) {
  const int count = model.provenance().training_poses;
  if (count < kFewestToLearn || model.parts().parameters.empty()) return std::nullopt;
  LearningCurve curve{"promised for 95 % of fresh poses, mm", ""};
  for (const double times : {0.5, 1.0, 2.0, 4.0}) {
    ModelParts parts = model.parts();
    parts.covariance /= times;
    parts.validation.reset();
    const Result<CompensatedModel> other = CompensatedModel::make(std::move(parts));
    const auto accuracy = other ? PositionAccuracy::of(*other) : std::nullopt;
    if (!accuracy) return std::nullopt;
    curve.poses.push_back(static_cast<int>(std::lround(times * count)));
    curve.error.push_back(accuracy->at(PositionAccuracy::kShare));
  }
  curve.sentence = fmt::format(
      "Twice as many poses would bring what can be promised from {:.4f} to {:.4f} mm: {}.",
      to_mm(curve.error[1]), to_mm(curve.error[2]), worth(curve.error[1], curve.error[2]));
  return curve;
}

}  // namespace

ShownPoses poses_to_show(const CompensatedModel& model,
                         const std::optional<MeasurementBatch>& batch) {
  if (batch) return poses_of(model, *batch);
  if (model.bias()) return poses_learned(model, *model.bias());
  return {};
}

ordered_json histogram_json(const ShownPoses& shown) {
  if (shown.poses.empty()) return nullptr;
  int first = bin_of(shown.poses.front().compensated), last = first;
  for (int level = 0; level < 3; ++level) {
    for (const Vector3& error : errors_at(shown, level)) {
      first = std::min(first, bin_of(error));
      last = std::max(last, bin_of(error));
    }
  }
  std::vector<std::string> labels;
  for (int bin = first; bin <= last; ++bin)
    labels.push_back(fmt::format("{:.2g} to {:.2g}", lower_end(bin), lower_end(bin + 1)));
  ordered_json json{{"title", "Error of " + shown.title}, {"labels_mm", labels}};
  const char* names[] = {"nominal", "calibrated", "compensated"};
  for (int level = 0; level < 3; ++level) {
    const std::vector<Vector3> errors = errors_at(shown, level);
    if (!errors.empty()) json[names[level]] = counted(errors, first, last);
  }
  return json;
}

ordered_json coverage_json(const ShownPoses& shown) {
  if (shown.poses.size() < kFewestToJudge) return nullptr;
  const std::vector<std::pair<double, double>> intervals = {
      {50, 0.67449}, {68.3, 1}, {80, 1.28155}, {90, 1.64485}, {95, 1.95996}, {99, 2.57583}};
  ordered_json json{{"stated", ordered_json::array()}, {"found", ordered_json::array()}};
  for (const auto& [percent, deviations] : intervals) {
    double inside = 0;
    for (const ShownPose& pose : shown.poses)
      inside += static_cast<double>(
          (pose.compensated.array().abs() <= deviations * pose.stddev.array()).count());
    json["stated"].push_back(percent);
    json["found"].push_back(100 * inside / (3.0 * static_cast<double>(shown.poses.size())));
  }
  return json;
}

std::string pose_table(const ShownPoses& shown) {
  if (shown.poses.empty())
    return "<p>This file knows no pose by itself: give <code>trammel report --batch</code> one "
           "that was not trained on.</p>";
  std::vector<const ShownPose*> order;
  for (const ShownPose& pose : shown.poses) order.push_back(&pose);
  std::stable_sort(order.begin(), order.end(), [](const ShownPose* a, const ShownPose* b) {
    return a->compensated.norm() > b->compensated.norm();
  });
  const std::size_t left_out = order.size() - std::min(order.size(), kMostListed);
  order.resize(order.size() - left_out);
  const auto mm = [](double m) { return fmt::format("{:.4f}", to_mm(m)); };
  std::vector<HtmlRow> rows;
  for (const ShownPose* pose : order) {
    const Vector3& left = pose->compensated;
    rows.push_back(
        {{html_text(pose->id), pose->nominal ? mm(pose->nominal->norm()) : "–",
          mm(pose->calibrated.norm()), mm(left.norm()), mm(left.x()), mm(left.y()), mm(left.z()),
          fmt::format("{:.1f}", left.norm() / std::max(pose->stddev.norm(), 1e-12)),
          pose->in_domain ? "" : "outside the domain"}});
  }
  const std::string more = left_out == 0
                               ? ""
                               : fmt::format(
                                     "<p class=\"note\">{} poses with smaller errors are left out; "
                                     "trammel evaluate --residuals lists all.</p>",
                                     left_out);
  return fmt::format(
             "<p class=\"note\">{}: {}. The worst come first<span class=\"screen\">; click on "
             "the name of a column to sort by it</span>.</p>\n",
             shown.poses.size(), html_text(shown.title)) +
         html_table({"poses flows sorts",
                     {"pose", "nominal, mm", "calibrated, mm", "compensated, mm", "its dx, mm",
                      "dy, mm", "dz, mm", "times its stated deviation", ""},
                     rows}) +
         more;
}

std::optional<LearningCurve> learning_curve(const CompensatedModel& model) {
  return model.bias() ? curve_of_bias(*model.bias()) : curve_of_parameters(model);
}

}  // namespace trammel
