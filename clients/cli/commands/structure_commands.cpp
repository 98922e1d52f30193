#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/structure_text.h"
#include "server/base/units.h"
#include "server/robot/cell.h"

namespace trammel::cli {

namespace {

struct CpaArguments {
  std::string robot, arcs, output, json;
  double sigma_mm = 0;
};

Status cpa(const CpaArguments& arguments) {
  const Chain robot = TRY(read_robot(arguments.robot));
  const ArcList arcs = TRY(read_arcs_csv(arguments.arcs, robot));
  CirclePointOptions options;
  if (arguments.sigma_mm > 0) options.sigma = from_mm(arguments.sigma_mm);
  const CirclePointResult result = TRY(analyse_circle_points(robot, arcs, options));
  if (!arguments.output.empty()) {
    TRY(write_output(arguments.output, circle_point_csv(result)));
  }
  tell(circle_point_text(result), {arguments.output, arguments.json});
  return write_json(arguments.json, circle_point_json(result));
}

struct DeflectionArguments {
  std::string data, json;
  double sigma_mm = to_mm(DeflectionOptions{}.sigma);
  bool chained = false;
  std::vector<int> load_bias;
  std::vector<double> validate;
};

Status deflection(const DeflectionArguments& arguments) {
  const DeflectionData data = TRY(read_deflection_csv(arguments.data));
  const DeflectionResult result =
      TRY(fit_deflection(data, {from_mm(arguments.sigma_mm), arguments.chained, arguments.load_bias,
                                arguments.validate}));
  tell(deflection_text(result), {arguments.json});
  return write_json(arguments.json, deflection_json(result));
}

void add_cpa(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<CpaArguments>();
  CLI::App* command =
      app.add_subcommand("cpa", "Circle-point analysis: link parameters from arcs of reflectors");
  command->add_option("--robot", arguments->robot, "Robot file (YAML), the nominal robot")
      ->required();
  command
      ->add_option("--arcs", arguments->arcs,
                   "Arcs (CSV: joint, q_deg, x_mm, y_mm, z_mm; optional reflector and the posture "
                   "q1_deg ...)")
      ->required();
  command
      ->add_option("--sigma-mm", arguments->sigma_mm,
                   "Standard deviation of one coordinate of a point, mm; left out: from how well "
                   "the arcs fit")
      ->check(above_zero());
  command->add_option("-o,--output", arguments->output,
                      "Table of parameters to write (CSV: mm, deg)");
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return cpa(*arguments); }; });
}

void add_deflection(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<DeflectionArguments>();
  CLI::App* command = app.add_subcommand(
      "deflection", "Joint compliance and link bending from reflectors under hung weights");
  command
      ->add_option("--data", arguments->data,
                   "Deflections (CSV: element, load_n, x_mm, dx_mm, dz_mm, theta_deg, length_mm, "
                   "lever_mm; optional sigma_mm, set)")
      ->required();
  command
      ->add_option("--sigma-mm", arguments->sigma_mm,
                   "Standard deviation of one coordinate where the file has none, mm")
      ->check(above_zero())
      ->capture_default_str();
  command->add_flag(
      "--chained", arguments->chained,
      "Deflections were measured against the ground, so they contain those of the elements before");
  command
      ->add_option("--load-bias", arguments->load_bias,
                   "Numbers of elements whose foot moves with the load, joined by commas")
      ->delimiter(',');
  command
      ->add_option("--validate", arguments->validate,
                   "Loads to hold out, N, joined by commas; left out: the column set, else every "
                   "third load from the second on")
      ->delimiter(',');
  add_json_option(*command, arguments->json);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return deflection(*arguments); }; });
}

}  // namespace

void add_structure_commands(CLI::App& app, Action& chosen) {
  add_cpa(app, chosen);
  add_deflection(app, chosen);
}

}  // namespace trammel::cli
