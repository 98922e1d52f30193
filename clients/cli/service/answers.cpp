#include "clients/cli/service/answers.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include "server/base/letters.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/pose_columns.h"
#include "server/report/note_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

constexpr double kNotLearned = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kPoseColumns = "x_mm,y_mm,z_mm,qw,qx,qy,qz";

std::string pose_fields(const client::PoseMm& pose) {
  std::string fields;
  for (const double value : {pose.x_mm, pose.y_mm, pose.z_mm, pose.qw, pose.qx, pose.qy, pose.qz}) {
    if (!fields.empty()) fields += ',';
    fields += csv_number(value);
  }
  return fields;
}

ordered_json pose_json(const client::PoseMm& pose) {
  return {{"x_mm", pose.x_mm}, {"y_mm", pose.y_mm}, {"z_mm", pose.z_mm}, {"qw", pose.qw},
          {"qx", pose.qx},     {"qy", pose.qy},     {"qz", pose.qz}};
}

/// True if there is a pose to command. If not, no numbers are written: a program could take them
/// for a command.
bool has_command(const client::CorrectedTarget& target) {
  return target.status == "ok" || target.status == "out_of_domain";
}

/// A joint of the wire as its column holds it: deg, of a prismatic joint mm.
double wire_to_column(double value, JointType type) {
  return type == JointType::kRevolute ? to_deg(value) : value;
}

JointType type_of(const std::vector<JointType>& types, std::size_t joint) {
  return joint < types.size() ? types[joint] : JointType::kRevolute;
}

std::size_t joint_count(const Corrections& corrections) {
  std::size_t joints = corrections.joint_types.size();
  for (const client::CorrectedTarget& item : corrections.items)
    joints = std::max(joints, item.q_rad.size());
  return joints;
}

}  // namespace

client::PoseMm to_wire(const Pose& X_BT) {
  const Eigen::Quaterniond R(X_BT.linear());
  const Vector3 p = X_BT.translation() * to_mm(1);
  return {p.x(), p.y(), p.z(), R.w(), R.x(), R.y(), R.z()};
}

client::PredictedError to_wire(const ErrorPrediction& prediction) {
  const Vector3 e = prediction.error_B * to_mm(1);
  const Vector3 s = prediction.stddev_B * to_mm(1);
  const Vector3 sl = prediction.true_stddev_B * to_mm(1);
  const Vector3 r = pose_difference(prediction.X_BT_predicted, prediction.X_BT_nominal).tail<3>();
  const Vector3 sr = prediction.rotation_stddev_B.value_or(Vector3::Constant(kNotLearned));
  const Matrix3 c = to_mm(1) * to_mm(1) * prediction.covariance_B;
  client::PredictedError item{to_wire(prediction.X_BT_nominal),
                              to_wire(prediction.X_BT_predicted),
                              e.x(),
                              e.y(),
                              e.z(),
                              s.x(),
                              s.y(),
                              s.z(),
                              prediction.in_domain};
  std::tie(item.rx_rad, item.ry_rad, item.rz_rad) = std::tuple(r.x(), r.y(), r.z());
  std::tie(item.slx_mm, item.sly_mm, item.slz_mm) = std::tuple(sl.x(), sl.y(), sl.z());
  std::tie(item.cxy_mm2, item.cxz_mm2, item.cyz_mm2) = std::tuple(c(0, 1), c(0, 2), c(1, 2));
  std::tie(item.srx_rad, item.sry_rad, item.srz_rad) = std::tuple(sr.x(), sr.y(), sr.z());
  item.bias_share = prediction.bias_weight;
  return item;
}

client::Approach approach_of(const PoseContext& context) {
  return {context.direction, context.temperature, context.time};
}

std::vector<double> to_wire(const JointVector& q, const std::vector<JointType>& joint_types) {
  std::vector<double> wire;
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const bool revolute = type_of(joint_types, static_cast<std::size_t>(j)) == JointType::kRevolute;
    wire.push_back(revolute ? q(j) : to_mm(q(j)));
  }
  return wire;
}

client::CorrectedTarget to_wire(const Correction& correction,
                                const std::vector<JointType>& joint_types) {
  return {std::string(to_string(correction.status)),
          to_wire(correction.X_BT_commanded),
          to_wire(correction.q, joint_types),
          to_mm(correction.error_before),
          to_mm(correction.error_after),
          to_mm(correction.stddev),
          correction.iterations,
          correction.message,
          to_mm(correction.measured_stddev),
          correction.turn_before,
          correction.turn_after};
}

client::TargetMm to_wire(const Target& target, const std::vector<JointType>& joint_types) {
  return {to_wire(target.X_BT),
          target.seed ? to_wire(*target.seed, joint_types) : std::vector<double>(), target.conf,
          target.joint_target, client::Approach{target.direction, target.temperature, target.time}};
}

Target from_wire(const client::TargetMm& wanted, const Chain& robot) {
  Target target;
  target.joint_target = wanted.joint_target;
  if (!target.joint_target) {
    const client::PoseMm& pose = wanted.pose;
    const Eigen::Quaterniond R(pose.qw, pose.qx, pose.qy, pose.qz);
    target.X_BT = make_pose(R.normalized().toRotationMatrix(),
                            Vector3(pose.x_mm, pose.y_mm, pose.z_mm) * from_mm(1));
  }
  target.direction = wanted.approach.directions;
  target.temperature = wanted.approach.temperature_c;
  target.time = wanted.approach.time_s;
  target.conf = wanted.conf;
  if (!wanted.conf && !wanted.seed_rad.empty()) target.seed = from_wire(wanted.seed_rad, robot);
  return target;
}

JointVector from_wire(const std::vector<double>& wire, const Chain& robot) {
  JointVector q(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const double value = wire[static_cast<std::size_t>(j)];
    q(j) = robot.joint(j).type == JointType::kPrismatic ? from_mm(value) : value;
  }
  return q;
}

JointUncertainty joint_uncertainty(const client::PredictedError& item) {
  return {item.cxy_mm2, item.cxz_mm2, item.cyz_mm2};
}

Result<RotationUncertainty> rotation_uncertainty(const client::PredictedError& item) {
  if (std::isnan(item.srx_rad))
    return refused(
        "the model learned no orientations: its training poses did not all have one, or its bias "
        "is none");
  return RotationUncertainty{to_deg(item.srx_rad), to_deg(item.sry_rad), to_deg(item.srz_rad)};
}

std::string predictions_csv(const JointList& list, const Predictions& predictions) {
  std::string text = fmt::format(
      "dx_mm,dy_mm,dz_mm,sx_mm,sy_mm,sz_mm,in_domain,{},pose_id,model_id,slx_mm,sly_mm,slz_mm",
      kPoseColumns);
  if (!predictions.together.empty()) text += ",cxy_mm2,cxz_mm2,cyz_mm2";
  if (!predictions.turned.empty()) text += ",srx_deg,sry_deg,srz_deg";
  text += "\n";
  for (std::size_t i = 0; i < predictions.items.size(); ++i) {
    const client::PredictedError& item = predictions.items[i];
    for (const double value :
         {item.dx_mm, item.dy_mm, item.dz_mm, item.sx_mm, item.sy_mm, item.sz_mm}) {
      text += csv_number(value) + ",";
    }
    text += fmt::format("{},{},{},{}", item.in_domain ? 1 : 0, pose_fields(item.predicted),
                        csv_field(list.poses[i].pose_id), predictions.model_id);
    for (const double value : {item.slx_mm, item.sly_mm, item.slz_mm})
      text += fmt::format(",{:.9g}", value);
    if (!predictions.together.empty()) {
      const JointUncertainty& u = predictions.together[i];
      for (const double value : {u.cxy_mm2, u.cxz_mm2, u.cyz_mm2})
        text += fmt::format(",{:.9g}", value);
    }
    if (!predictions.turned.empty()) {
      const RotationUncertainty& u = predictions.turned[i];
      for (const double value : {u.srx_deg, u.sry_deg, u.srz_deg})
        text += fmt::format(",{:.9g}", value);
    }
    text += "\n";
  }
  return text;
}

ordered_json predictions_json(const JointList& list, const Predictions& predictions) {
  ordered_json items = ordered_json::array();
  for (std::size_t i = 0; i < predictions.items.size(); ++i) {
    const client::PredictedError& item = predictions.items[i];
    items.push_back({{"pose_id", list.poses[i].pose_id},
                     {"dx_mm", item.dx_mm},
                     {"dy_mm", item.dy_mm},
                     {"dz_mm", item.dz_mm},
                     {"sx_mm", item.sx_mm},
                     {"sy_mm", item.sy_mm},
                     {"sz_mm", item.sz_mm},
                     {"slx_mm", item.slx_mm},
                     {"sly_mm", item.sly_mm},
                     {"slz_mm", item.slz_mm},
                     {"in_domain", item.in_domain},
                     {"nominal", pose_json(item.nominal)},
                     {"predicted", pose_json(item.predicted)}});
    if (!predictions.turned.empty()) {
      const RotationUncertainty& u = predictions.turned[i];
      items.back().update({{"srx_deg", u.srx_deg}, {"sry_deg", u.sry_deg}, {"srz_deg", u.srz_deg}});
    }
    if (predictions.together.empty()) continue;
    const JointUncertainty& u = predictions.together[i];
    items.back().update({{"cxy_mm2", u.cxy_mm2}, {"cxz_mm2", u.cxz_mm2}, {"cyz_mm2", u.cyz_mm2}});
  }
  return {{"model", predictions.model_id},
          {"notes", notes_json(predictions.notes)},
          {"predictions", items}};
}

namespace {

/// The columns of corrections_csv() without those of the target file.
std::vector<std::string> correction_columns(const Corrections& corrections) {
  std::vector<std::string> columns = {"row", "status", "x_mm", "y_mm", "z_mm",
                                      "qw",  "qx",     "qy",   "qz"};
  const std::size_t joints = joint_count(corrections);
  for (std::size_t j = 0; j < joints; ++j) {
    columns.push_back(joint_column(static_cast<int>(j), type_of(corrections.joint_types, j)));
  }
  for (const char* name :
       {"error_before_mm", "error_after_mm", "sigma_mm", "iterations", "model_id", "message",
        "sigma_measured_mm", "turn_before_deg", "turn_after_deg"}) {
    columns.emplace_back(name);
  }
  return columns;
}

/// The names of the file's columns where `ours` stand behind them: none is named twice, whatever
/// the case.
std::vector<std::string> kept_columns(const std::vector<std::string>& columns,
                                      const std::vector<std::string>& ours) {
  std::set<std::string> taken;
  for (const std::string& name : ours) taken.insert(lower(name));
  std::vector<std::string> kept = columns;
  std::vector<std::size_t> clashing;
  for (std::size_t k = 0; k < kept.size(); ++k) {
    if (taken.contains(lower(kept[k]))) clashing.push_back(k);
  }
  for (const std::string& name : kept) taken.insert(lower(name));
  for (const std::size_t k : clashing) {
    while (taken.contains(lower(kept[k]))) kept[k] = "input_" + kept[k];
    taken.insert(lower(kept[k]));
  }
  return kept;
}

/// Empty where there is nothing to say.
std::string field_of(double value) { return std::isfinite(value) ? csv_number(value) : ""; }
ordered_json json_of(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

}  // namespace

std::string corrections_csv(const TargetFile& file, const Corrections& corrections) {
  const std::vector<std::string> ours = correction_columns(corrections);
  std::string text;
  for (const std::string& name : kept_columns(file.columns, ours)) text += csv_field(name) + ",";
  text += fmt::format("{}\n", fmt::join(ours, ","));
  const std::size_t joints = joint_count(corrections);
  for (std::size_t i = 0; i < corrections.items.size(); ++i) {
    const client::CorrectedTarget& item = corrections.items[i];
    const bool command = has_command(item);
    for (const std::string& field : file.rows[i].fields) text += csv_field(field) + ",";
    text += fmt::format("{},{},{}", file.rows[i].row, item.status,
                        command ? pose_fields(item.commanded) : ",,,,,,");
    for (std::size_t j = 0; j < joints; ++j) {
      text += ',';
      if (command && j < item.q_rad.size()) {
        text += csv_number(wire_to_column(item.q_rad[j], type_of(corrections.joint_types, j)));
      }
    }
    text += fmt::format(",{},{},{},{},{},{}", field_of(item.error_before_mm),
                        field_of(item.error_after_mm), field_of(item.sigma_mm), item.iterations,
                        corrections.model_id, csv_field(item.message));
    text +=
        fmt::format(",{},{},{}\n", field_of(item.sigma_measured_mm),
                    field_of(to_deg(item.turn_before_rad)), field_of(to_deg(item.turn_after_rad)));
  }
  return text;
}

ordered_json corrections_json(const TargetFile& file, const Corrections& corrections) {
  ordered_json items = ordered_json::array();
  for (std::size_t i = 0; i < corrections.items.size(); ++i) {
    const client::CorrectedTarget& item = corrections.items[i];
    ordered_json json = {
        {"row", file.rows[i].row}, {"status", item.status}, {"message", item.message}};
    json["input"] = ordered_json::object();
    for (std::size_t k = 0; k < file.rows[i].fields.size(); ++k) {
      json["input"][file.columns[k]] = file.rows[i].fields[k];
    }
    if (has_command(item)) {
      ordered_json joints = ordered_json::object();
      for (std::size_t j = 0; j < item.q_rad.size(); ++j) {
        const JointType type = type_of(corrections.joint_types, j);
        joints[joint_column(static_cast<int>(j), type)] = wire_to_column(item.q_rad[j], type);
      }
      json["commanded"] = pose_json(item.commanded);
      json["joints"] = joints;
    }
    json["error_before_mm"] = json_of(item.error_before_mm);
    json["error_after_mm"] = json_of(item.error_after_mm);
    json["sigma_mm"] = json_of(item.sigma_mm);
    json["sigma_measured_mm"] = json_of(item.sigma_measured_mm);
    json["turn_before_deg"] = json_of(to_deg(item.turn_before_rad));
    json["turn_after_deg"] = json_of(to_deg(item.turn_after_rad));
    json["iterations"] = item.iterations;
    items.push_back(json);
  }
  return {{"model", corrections.model_id}, {"targets", items}};
}

std::string corrections_summary(const Corrections& corrections) {
  std::map<std::string, int> counts;
  for (const client::CorrectedTarget& item : corrections.items) ++counts[item.status];
  std::string text = fmt::format("{} targets:", corrections.items.size());
  const char* separator = " ";
  for (const auto& [status, count] : counts) {
    text += fmt::format("{}{} {}", separator, count, status);
    separator = ", ";
  }
  return text + "\n";
}

std::string left_alone_text(const TargetFile& file, const Corrections& corrections) {
  constexpr std::size_t kLines = 10;
  std::string lines;
  std::size_t left = 0;
  for (std::size_t i = 0; i < corrections.items.size(); ++i) {
    const client::CorrectedTarget& item = corrections.items[i];
    if (has_command(item) || ++left > kLines) continue;
    lines += fmt::format("  {} row {}: {}: {}\n", file.where, file.rows[i].row, item.status,
                         item.message);
  }
  if (left == 0) return "";
  if (left > kLines) lines += fmt::format("  and {} more\n", left - kLines);
  return fmt::format("{} of {} targets are left as they were:\n{}", left, corrections.items.size(),
                     lines);
}

}  // namespace trammel::cli
