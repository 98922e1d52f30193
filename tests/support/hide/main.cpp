// Hides an effect in a cell that it draws, and writes batch.csv, cell.yaml, robot.yaml and the
// sealed truth.json. `trammel_hide --kind KIND --seed S --lambda L [--poses N] [--ranges R]
// [--position-only] [--validation SHARE] -o FOLDER`
#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>

#include "tests/support/hidden_case.h"

namespace {

void write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream out(path);
  out << text;
  if (!out.flush()) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace

int main(int argc, char** argv) {
  trammel::hidden::HiddenSpec spec;
  bool position_only = false;
  std::string folder = ".";
  CLI::App app("Hides an effect in a measured cell.");
  app.add_option("--kind", spec.kind,
                 "a cause, causes joined by '+', mixture2, mixture3, null_..., unknown_..., ...");
  app.add_option("--seed", spec.seed);
  app.add_option("--lambda", spec.lambda, "strength outside what the cell's error sources explain");
  app.add_option("--poses", spec.poses);
  app.add_option("--ranges", spec.ranges, "calibration, 1dim, 3dim, 6dim-s, 6dim-m, 6dim-l");
  app.add_option("--validation", spec.validation_share,
                 "share of the poses set aside for validation");
  app.add_flag("--position-only", position_only);
  app.add_option("-o,--output", folder, "an existing folder");
  CLI11_PARSE(app, argc, argv);
  spec.orientation = !position_only;
  const trammel::hidden::HiddenCase hidden = trammel::hidden::hide(spec);
  try {
    const std::filesystem::path path(folder);
    write(path / "batch.csv", hidden.batch_csv);
    write(path / "cell.yaml", hidden.cell_yaml);
    write(path / "robot.yaml", hidden.robot_yaml);
    write(path / "truth.json", to_json(hidden.truth, hidden.world));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
