#include "clients/cli/text/structure_text.h"

#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/report/note_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

constexpr double to_um(double m) { return m * 1e6; }
/// 1/(N m^2) -> 1/(Nmm^2), and m/Nm -> mm/Nmm.
constexpr double to_per_nmm2(double flexibility) { return flexibility * 1e-6; }
constexpr double to_mm_per_nmm(double bias) { return bias; }

double shown(double value, bool length) { return length ? to_mm(value) : to_deg(value); }

ordered_json vector_json(const Eigen::VectorXd& v) {
  return std::vector<double>(v.data(), v.data() + v.size());
}

std::string parameter_lines(const CirclePointResult& result, bool length) {
  std::string text;
  for (const MeasuredParameter& parameter : result.parameters) {
    if (parameter.length != length) continue;
    const std::string name = fmt::format("{} [{}]", parameter.name, length ? "mm" : "deg");
    if (!parameter.measured) {
      text += fmt::format("  {:<14}{:>12.4f}{:>12}{:>10}\n", name, shown(parameter.nominal, length),
                          "-", "-");
      continue;
    }
    text +=
        fmt::format("  {:<14}{:>12.4f}{:>12.4f}{:>10.4f}\n", name, shown(parameter.nominal, length),
                    shown(parameter.deviation, length), shown(parameter.u, length));
  }
  return text;
}

}  // namespace

std::string circle_point_text(const CirclePointResult& result) {
  std::string text = fmt::format("  {:<12}{:>7}{:>10}{:>12}{:>13}{:>13}{:>13}{:>14}\n", "arc",
                                 "points", "span, deg", "radius, mm", "plane, um", "circle, um",
                                 "centre U, um", "normal U, deg");
  for (const CircleFit& circle : result.circles) {
    const std::string name = fmt::format("J{} {}", circle.joint + 1, circle.reflector);
    text += fmt::format("  {:<12}{:>7}{:>10.1f}{:>12.3f}{:>13.2f}{:>13.2f}{:>13.1f}{:>14.5f}\n",
                        name, circle.points, to_deg(circle.span), to_mm(circle.radius),
                        to_um(circle.plane_rms), to_um(circle.circle_rms), to_um(circle.centre_u),
                        to_deg(result.axes[static_cast<std::size_t>(circle.joint)].direction_u));
  }
  const std::string header = fmt::format("{:>12}{:>12}{:>10}\n", "nominal", "deviation", "U(k=2)");
  text += fmt::format("\n  {:<14}{}", "lengths", header) + parameter_lines(result, true);
  text += fmt::format("\n  {:<14}{}", "angles", header) + parameter_lines(result, false);
  text += "\n";
  for (const MeasuredParameter& parameter : result.parameters) {
    if (!parameter.measured)
      text += fmt::format("  {} not measured: {}\n", parameter.name, parameter.note);
  }
  for (const Note& note : result.notes) text += fmt::format("  {}\n", note.text);
  return text;
}

namespace {

ordered_json circle_json(const CircleFit& circle) {
  return {{"joint", circle.joint + 1},
          {"reflector", circle.reflector},
          {"points", circle.points},
          {"span_deg", to_deg(circle.span)},
          {"centre_mm", vector_json(circle.centre_W * to_mm(1))},
          {"centre_u95_mm", to_mm(circle.centre_u)},
          {"radius_mm", to_mm(circle.radius)},
          {"plane_rms_mm", to_mm(circle.plane_rms)},
          {"circle_rms_mm", to_mm(circle.circle_rms)}};
}

/// `joint`: from 1.
ordered_json axis_json(const JointAxis& axis, std::size_t joint) {
  return {{"joint", joint},
          {"direction", vector_json(axis.direction_W)},
          {"point_mm", vector_json(axis.point_W * to_mm(1))},
          {"direction_u95_deg", to_deg(axis.direction_u)},
          {"sigma_mm", to_mm(axis.sigma)},
          {"freedom", axis.freedom},
          {"angle_rms_deg", to_deg(axis.angle_rms)}};
}

ordered_json parameter_json(const MeasuredParameter& parameter) {
  const bool length = parameter.length;
  ordered_json json = {{"name", parameter.name},
                       {"unit", length ? "mm" : "deg"},
                       {"nominal", shown(parameter.nominal, length)},
                       {"measured", parameter.measured}};
  if (parameter.measured) {
    json["deviation"] = shown(parameter.deviation, length);
    json["u95"] = shown(parameter.u, length);
  } else {
    json["note"] = parameter.note;
  }
  return json;
}

}  // namespace

ordered_json circle_point_json(const CirclePointResult& result) {
  ordered_json json = {{"robot", result.robot.name()}};
  for (const CircleFit& circle : result.circles) json["circles"].push_back(circle_json(circle));
  for (std::size_t j = 0; j < result.axes.size(); ++j)
    if (result.axes[j].sigma > 0 || !result.axes[j].direction_W.isZero())
      json["axes"].push_back(axis_json(result.axes[j], j + 1));
  for (const MeasuredParameter& parameter : result.parameters)
    json["parameters"].push_back(parameter_json(parameter));
  json["notes"] = notes_json(result.notes);
  const Eigen::Quaterniond q(result.X_WB.linear());
  json["base"] = {{"xyz_mm", vector_json(result.X_WB.translation() * to_mm(1))},
                  {"q_wxyz", {q.w(), q.x(), q.y(), q.z()}}};
  return json;
}

std::string circle_point_csv(const CirclePointResult& result) {
  std::string text = "parameter,unit,nominal,deviation,u95,measured,note\n";
  for (const MeasuredParameter& parameter : result.parameters) {
    const bool length = parameter.length;
    const std::string numbers = parameter.measured
                                    ? csv_number(shown(parameter.deviation, length)) + "," +
                                          csv_number(shown(parameter.u, length))
                                    : std::string(",");
    text += fmt::format("{},{},{},{},{},{}\n", parameter.name, length ? "mm" : "deg",
                        csv_number(shown(parameter.nominal, length)), numbers,
                        parameter.measured ? 1 : 0, csv_field(parameter.note));
  }
  return text;
}

namespace {

const char* verdict_text(LinkVerdict verdict) {
  switch (verdict) {
    case LinkVerdict::kBends:
      return "bends";
    case LinkVerdict::kRigid:
      return "rigid";
    case LinkVerdict::kCannotTell:
      return "cannot tell";
  }
  return "";
}

std::string fit_line(const char* model, const DeflectionFit& fit) {
  std::string stiffness = "n/a";
  if (fit.flexibility) stiffness = fmt::format("{:.4g}", 1 / to_per_nmm2(*fit.flexibility));
  std::string bias;
  if (fit.load_bias) {
    bias = fmt::format("  Bx {:.4g}  Bz {:.4g} mm/Nmm", to_mm_per_nmm(fit.load_bias->x()),
                       to_mm_per_nmm(fit.load_bias->y()));
  }
  return fmt::format("    {:<9}{:>12}{:>14.4g}{:>12.2g}{:>9.3f}{:>9.3f}{:>12.4f}{:>12.4f}{}\n",
                     model, stiffness, to_rad_per_nmm(fit.compliance),
                     to_rad_per_nmm(fit.compliance_u), to_mm(fit.offset.x()), to_mm(fit.offset.y()),
                     to_mm(fit.rms_train), to_mm(fit.rms_validation), bias);
}

ordered_json fit_json(const DeflectionFit& fit) {
  ordered_json json = {{"compliance_rad_per_nmm", to_rad_per_nmm(fit.compliance)},
                       {"compliance_u95_rad_per_nmm", to_rad_per_nmm(fit.compliance_u)},
                       {"offset_mm", vector_json(fit.offset * to_mm(1))},
                       {"offset_u95_mm", vector_json(fit.offset_u * to_mm(1))}};
  if (fit.flexibility) {
    json["flexibility_per_nmm2"] = to_per_nmm2(*fit.flexibility);
    json["flexibility_u95_per_nmm2"] = to_per_nmm2(fit.flexibility_u);
  }
  if (fit.load_bias) {
    json["load_bias_mm_per_nmm"] = vector_json(*fit.load_bias);
    json["load_bias_u95_mm_per_nmm"] = vector_json(fit.load_bias_u);
  }
  json["rms_train_mm"] = to_mm(fit.rms_train);
  json["rms_validation_mm"] = to_mm(fit.rms_validation);
  return json;
}

std::string element_text(const ElementResult& element) {
  std::string text = fmt::format(
      "\n  element {}\n    {:<9}{:>12}{:>14}{:>12}{:>9}{:>9}{:>12}{:>12}\n", element.element, "",
      "EI, Nmm^2", "C, rad/Nmm", "U(k=2)", "Ax, mm", "Az, mm", "train, mm", "valid., mm");
  if (element.beam) text += fit_line("model 1", *element.beam);
  text += fit_line("model 2", element.rigid);
  if (element.beam) {
    text += fmt::format("    beam term: F {:.3g}, p {:.2g}, AIC better by {:.3g}\n", element.f,
                        element.p_value, element.aic_gain);
  }
  return text + fmt::format("    {}\n", element.sentence);
}

}  // namespace

std::string deflection_text(const DeflectionResult& result) {
  std::string text =
      fmt::format("trained on {:.3f} N, validated on {:.3f} N\n",
                  fmt::join(result.training_loads, ", "), fmt::join(result.validation_loads, ", "));
  for (const ElementResult& element : result.elements) text += element_text(element);
  return text +
         fmt::format("\n  rms |dp|, mm: nothing predicted {:.4f}, model 1 {:.4f}, model 2 {:.4f}\n",
                     to_mm(result.rms_still), to_mm(result.rms_beam), to_mm(result.rms_rigid));
}

namespace {

ordered_json element_json(const ElementResult& element) {
  ordered_json json = {{"element", element.element}, {"link", verdict_text(element.verdict)}};
  if (element.beam) {
    json["model_1"] = fit_json(*element.beam);
    json["beam_term"] = {{"f", element.f},
                         {"p_value", element.p_value},
                         {"aic_gain", element.aic_gain},
                         {"end_bending_mm", to_mm(element.end_bending)},
                         {"end_bending_u95_mm", to_mm(element.end_bending_u)}};
  }
  json["model_2"] = fit_json(element.rigid);
  json["load_bias_p_value"] = element.load_bias_p_value;
  json["sentence"] = element.sentence;
  return json;
}

}  // namespace

ordered_json deflection_json(const DeflectionResult& result) {
  ordered_json json = {{"training_loads_n", result.training_loads},
                       {"validation_loads_n", result.validation_loads},
                       {"variance_factor", result.variance_factor},
                       {"freedom", result.freedom}};
  for (const ElementResult& element : result.elements)
    json["elements"].push_back(element_json(element));
  json["rms_mm"] = {{"nothing_predicted", to_mm(result.rms_still)},
                    {"model_1", to_mm(result.rms_beam)},
                    {"model_2", to_mm(result.rms_rigid)}};
  return json;
}

}  // namespace trammel::cli
