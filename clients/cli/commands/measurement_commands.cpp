#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <map>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/files/near_columns.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/units.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/files/references.h"
#include "server/measurement/gauges.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

struct ConvertArguments {
  std::string points, joints, robodk, table, unit, coordinates, behind, tool, payload, output, json;
  std::vector<std::string> columns;
  double coverage = 1;
  bool in_order = false;
};

const std::map<std::string, LengthUnit> kUnits = {
    {"mm", LengthUnit::kMillimetre}, {"m", LengthUnit::kMetre}, {"inch", LengthUnit::kInch}};
const std::map<std::string, Coordinates> kCoordinates = {{"cartesian", Coordinates::kCartesian},
                                                         {"cylindrical", Coordinates::kCylindrical},
                                                         {"spherical", Coordinates::kSpherical}};
const std::map<std::string, BehindCoordinates> kBehind = {
    {"uncertainties", BehindCoordinates::kUncertainties},
    {"fixed-xyz", BehindCoordinates::kFixedXyz},
    {"euler-zyx", BehindCoordinates::kEulerZyx}};

/// The value of an option; nothing when it was not given.
template <typename T>
std::optional<T> said(const std::map<std::string, T>& words, const std::string& word) {
  const auto at = words.find(word);
  return at == words.end() ? std::nullopt : std::optional(at->second);
}

template <typename T>
CLI::Validator one_of(const std::map<std::string, T>& words) {
  std::vector<std::string> names;
  for (const auto& entry : words) names.push_back(entry.first);
  return CLI::IsMember(names);
}

/// A batch and how many planned poses it lacks.
struct Converted {
  MeasurementBatch batch;
  std::size_t not_measured = 0;
};

Result<Converted> read_converted(const ConvertArguments& arguments) {
  if (!arguments.robodk.empty()) {
    return read_robodk_csv(arguments.robodk).map([](MeasurementBatch batch) {
      return Converted{std::move(batch), 0};
    });
  }
  if (!arguments.table.empty()) {
    return read_batch_table(arguments.table, arguments.columns).map([](MeasurementBatch batch) {
      return Converted{std::move(batch), 0};
    });
  }
  const PointFileOptions options{said(kUnits, arguments.unit),
                                 said(kCoordinates, arguments.coordinates),
                                 said(kBehind, arguments.behind), arguments.coverage};
  const PointList points = TRY(read_points(arguments.points, options));
  const JointList joints = TRY(read_joint_file(arguments.joints));
  return join_points(points, joints, arguments.in_order).map([&](MeasurementBatch batch) {
    const std::size_t not_measured = joints.poses.size() - batch.measurements.size();
    return Converted{std::move(batch), not_measured};
  });
}

Status convert(const ConvertArguments& arguments) {
  if (!arguments.points.empty() && arguments.joints.empty()) {
    return failure(ErrorCode::kUsage, "--points needs --joints")
        .of("--joints")
        .next("name the plan that was measured");
  }
  Converted converted = TRY(read_converted(arguments));
  for (Measurement& m : converted.batch.measurements) {
    if (m.context.tool.empty()) m.context.tool = arguments.tool;
    if (m.context.payload.empty()) m.context.payload = arguments.payload;
  }
  const std::string& from = !arguments.robodk.empty()  ? arguments.robodk
                            : !arguments.table.empty() ? arguments.table
                                                       : arguments.points;
  tell_columns_left_aside(converted.batch, "", from);
  const std::size_t count = converted.batch.measurements.size();
  TRY(write_output(arguments.output, to_csv(converted.batch)));
  tell(fmt::format("{} measurements in {}{}\n", count, arguments.output,
                   converted.not_measured == 0
                       ? ""
                       : fmt::format("; {} poses of {} not measured", converted.not_measured,
                                     arguments.joints)),
       {arguments.output, arguments.json});
  return write_json(arguments.json,
                    {{"measurements", count}, {"not_measured", converted.not_measured}});
}

struct ReferencesArguments {
  std::string nominal, measured, batch, output, json;
  double localise_above_mm = to_mm(ReferenceOptions().localise_above);
  double repeat_above_mm = to_mm(ReferenceOptions().repeat_above);
};

const char* verdict_name(ReferenceVerdict verdict) {
  switch (verdict) {
    case ReferenceVerdict::kFine:
      return "fine";
    case ReferenceVerdict::kLocalise:
      return "localise";
    case ReferenceVerdict::kLocaliseAndRepeat:
      return "localise_and_repeat";
  }
  return "";
}

std::string references_text(const ReferenceCheck& check) {
  std::string text =
      fmt::format("{:<16}{:>15}{:>20}\n", "reflector", "difference mm", "after transform mm");
  for (const ReferenceResidual& residual : check.residuals) {
    text += fmt::format("{:<16}{:>15.4f}{:>20.4f}\n", residual.name,
                        to_mm(residual.difference_W.norm()), to_mm(residual.remaining_W.norm()));
  }
  text += fmt::format("{:<16}{:>15.4f}{:>20.4f}\n", "rms", to_mm(check.rms),
                      to_mm(check.rms_remaining));
  if (!check.not_measured.empty())
    text += fmt::format("not measured: {}\n", fmt::join(check.not_measured, ", "));
  if (!check.rigid) {
    return text +
           fmt::format(
               "the reflectors moved against each other, {} the most: nothing can be localised\n",
               check.worst);
  }
  switch (check.verdict) {
    case ReferenceVerdict::kFine:
      return text + "fine: the tracker stands where it stood\n";
    case ReferenceVerdict::kLocalise:
      return text + "localise: apply the transform to what is measured from now on\n";
    case ReferenceVerdict::kLocaliseAndRepeat:
      return text +
             "localise and repeat: apply the transform, and repeat the test before this check\n";
  }
  return text;
}

ordered_json references_json(const ReferenceCheck& check) {
  const Eigen::Quaterniond q(check.X_WV.linear());
  const Vector3 p_mm = 1e3 * check.X_WV.translation();
  ordered_json reflectors = ordered_json::array();
  for (const ReferenceResidual& residual : check.residuals) {
    reflectors.push_back({{"name", residual.name},
                          {"difference_mm", to_mm(residual.difference_W.norm())},
                          {"remaining_mm", to_mm(residual.remaining_W.norm())}});
  }
  return {{"verdict", verdict_name(check.verdict)},
          {"rms_mm", to_mm(check.rms)},
          {"rms_remaining_mm", to_mm(check.rms_remaining)},
          {"rigid", check.rigid},
          {"worst", check.worst},
          {"reflectors", std::move(reflectors)},
          {"not_measured", check.not_measured},
          {"transform",
           {{"xyz_mm", {p_mm.x(), p_mm.y(), p_mm.z()}}, {"q_wxyz", {q.w(), q.x(), q.y(), q.z()}}}}};
}

Status localise_batch(const ReferencesArguments& arguments, const ReferenceCheck& check) {
  if (arguments.batch.empty()) return {};
  if (!check.rigid) {
    return refused(
               "not localised: {:.4f} mm rms remain after the transform, limit {:g} mm; worst is "
               "reflector {}",
               to_mm(check.rms_remaining), arguments.repeat_above_mm, check.worst)
        .in(arguments.batch)
        .beyond(to_mm(check.rms_remaining), arguments.repeat_above_mm)
        .with_text(check.worst);
  }
  MeasurementBatch batch = TRY(read_batch_file(arguments.batch));
  TRY(require_positions(batch, "references --batch"));
  const Pose X_WV = check.verdict == ReferenceVerdict::kFine ? Pose::Identity() : check.X_WV;
  return write_output(arguments.output, to_csv(localised(std::move(batch), X_WV)));
}

Status check_reflectors(const ReferencesArguments& arguments) {
  if (arguments.batch.empty() != arguments.output.empty()) {
    return failure(ErrorCode::kUsage, "--batch and --output belong together")
        .of(arguments.batch.empty() ? "--batch" : "--output");
  }
  const PointList nominal = TRY(read_points(arguments.nominal));
  const PointList measured = TRY(read_points(arguments.measured));
  const ReferenceCheck check = TRY(
      check_references(nominal, measured,
                       {from_mm(arguments.localise_above_mm), from_mm(arguments.repeat_above_mm)}));
  tell(references_text(check), {arguments.output, arguments.json});
  TRY(write_json(arguments.json, references_json(check)));
  return localise_batch(arguments, check);
}

void add_convert(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<ConvertArguments>();
  CLI::App* command =
      app.add_subcommand("convert", "Make a batch of measurements that other programs exported");
  CLI::Option_group* what = command->add_option_group("Measurements");
  CLI::Option* points = what->add_option("--points", arguments->points,
                                         "Points or frames exported by SpatialAnalyzer (ASCII) or "
                                         "Leica Tracker Pilot (CSV), with --joints");
  what->add_option("--robodk", arguments->robodk,
                   "Measurements exported by a RoboDK calibration project (CSV)");
  CLI::Option* table = what->add_option("--table", arguments->table,
                                        "A table whose --columns you tell, whatever it names them");
  what->require_option(1);
  CLI::Option* columns =
      command
          ->add_option(
              "--columns", arguments->columns,
              "Columns of --table in their order, joined by commas: q1_deg,...,x_mm,y_mm,z_mm and "
              "any other of a batch; _rad and _m for other units, skip to pass one over")
          ->delimiter(',')
          ->needs(table);
  table->needs(columns);
  command
      ->add_option("--joints", arguments->joints,
                   "Plan that was measured (CSV: joints in deg, rails in mm); its pose_id is the "
                   "point's name")
      ->needs(points);
  command
      ->add_flag("--in-order", arguments->in_order,
                 "The first point measures the first pose, and so on: names do not count")
      ->needs(points);
  command
      ->add_option("--unit", arguments->unit,
                   "Unit of the points' lengths where the file does not say; else mm")
      ->check(one_of(kUnits))
      ->needs(points);
  command
      ->add_option("--coordinates", arguments->coordinates,
                   "Coordinates of the points where the file does not say; else cartesian")
      ->check(one_of(kCoordinates))
      ->needs(points);
  command
      ->add_option("--behind", arguments->behind,
                   "What three values behind the coordinates are, where the file does not say")
      ->check(one_of(kBehind))
      ->needs(points);
  command
      ->add_option("--coverage", arguments->coverage,
                   "How many standard deviations the uncertainties in the file are")
      ->check(CLI::Range(0.1, 10.0))
      ->capture_default_str()
      ->needs(points);
  add_tool_options(*command, arguments->tool, arguments->payload);
  command
      ->add_option("-o,--output", arguments->output,
                   "Batch to write (CSV: joints in deg, rails in mm; positions in mm)")
      ->required();
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return convert(*arguments); }; });
}

void add_references(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<ReferencesArguments>();
  CLI::App* command = app.add_subcommand(
      "references", "Tell from reference reflectors whether the tracker has moved, and where to");
  command
      ->add_option("--nominal", arguments->nominal,
                   "Reflectors as first measured (CSV: name, x_mm, y_mm, z_mm)")
      ->required();
  command
      ->add_option("--measured", arguments->measured,
                   "The same reflectors as measured now (CSV: name, x_mm, y_mm, z_mm)")
      ->required();
  command->add_option("--batch", arguments->batch,
                      "Batch to move into the frame of the nominal reflectors (needs --output); "
                      "stays as it is where all is fine");
  command->add_option(
      "-o,--output", arguments->output,
      "The moved batch to write (CSV: joints in deg, rails in mm; positions in mm)");
  command
      ->add_option("--localise-above-mm", arguments->localise_above_mm,
                   "Rms difference above which the tracker is to be localised again, mm")
      ->capture_default_str();
  command
      ->add_option("--repeat-above-mm", arguments->repeat_above_mm,
                   "Rms difference above which the test before is to be repeated, too, mm")
      ->capture_default_str();
  add_json_option(*command, arguments->json);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return check_reflectors(*arguments); }; });
}

}  // namespace

void add_measurement_commands(CLI::App& app, Action& chosen) {
  add_convert(app, chosen);
  add_references(app, chosen);
}

}  // namespace trammel::cli
