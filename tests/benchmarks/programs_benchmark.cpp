// Programs in, programs out, on the shipped virtual robot: what share of motions is corrected,
// where the tool then really goes, how often it is where it was said to be, and what 100,000
// targets cost beside the evaluation alone. And how smooth corrections are along a circle and a
// spiral. --models N, --targets N, --only errors|cost|share|smooth.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <random>

#include "clients/cam/correct_program.h"
#include "clients/cam/dialect.h"
#include "clients/cli/command_line.h"
#include "clients/cli/service/answers.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/work/in_parallel.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/compensate/exchanged.h"
#include "server/compensate/model_file.h"
#include "server/measurement/pose_columns.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

const std::string kTool =
    "  PERS tooldata "
    "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];"
    "\n";

CompensatedModel trained(const VirtualRobot& robot, std::uint64_t seed,
                         const std::string& bias = "se") {
  TrainOptions options;
  options.level = "M3";
  options.bias = bias;
  return test::demand(train(robot.truth.cell, test::measured(robot, 150, seed), options));
}

std::string motion(const Vector3& p_mm) {
  return fmt::format(
      "    MoveL "
      "[[{:.2f},{:.2f},{:.2f}],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,"
      "z1,tSpindle;\n",
      p_mm.x(), p_mm.y(), p_mm.z());
}

/// Targets in front of the robot.
std::string scattered(int targets, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> x(1500, 1900), y(0, 600), z(700, 1400);
  std::string text = "MODULE M\n" + kTool + "  PROC main()\n";
  for (int i = 0; i < targets; ++i) text += motion({x(random), y(random), z(random)});
  return text + "  ENDPROC\nENDMODULE\n";
}

/// A contour of neighbours 0.2 mm apart.
std::string contour(int targets) {
  std::string text = "MODULE M\n" + kTool + "  PROC main()\n";
  for (int i = 0; i < targets; ++i) {
    const double r = 60 + 60.0 * i / targets, a = 0.2 * i / r;
    text += motion({1800, 125 + r * std::cos(a), 1200 + r * std::sin(a)});
  }
  return text + "  ENDPROC\nENDMODULE\n";
}

cam::AskCorrections by(const CompensatedModel& model) {
  return [&](const std::string& tool, const std::string& payload,
             const std::vector<exchange::AskedTarget>& targets)
             -> Result<exchange::Answer<exchange::CorrectedTarget>> {
    exchange::Answer<exchange::CorrectedTarget> answer{cli::info_of(model), {}};
    const exchange::Rails rails = exchange::rails_of(model.cell().robot);
    for (const exchange::AskedTarget& target : targets)
      answer.items.push_back(
          exchanged(model.correct(target_of(target, model.cell().robot), tool, payload), rails));
    return answer;
  };
}

/// Where the tool really goes.
Pose truth_at(const VirtualRobot& robot, const JointVector& q) {
  PoseContext context;
  context.q = q;
  context.tool = context.payload = "spindle";
  return robot.truth.pose_W(context);  // cell-7: B stands in W's origin
}

struct Errors {
  double squares_before = 0, squares = 0, most_before = 0, most = 0;
  int count = 0, inside = 0;
};

void add_errors(const VirtualRobot& robot, const CompensatedModel& model,
                const cam::CorrectedProgram& made, Errors& errors) {
  const Pose X_TF = model.parts().physics.tools.at("spindle").inverse();
  const Chain& arm = model.cell().robot;
  for (const cam::ReceiptRow& row : made.rows) {
    if (row.status != "ok") continue;
    JointVector seed(6);
    for (Eigen::Index j = 0; j < 6; ++j)
      seed(j) = from_deg(row.joints[static_cast<std::size_t>(j)]);
    const auto joints = [&](const std::vector<double>& numbers) {
      return inverse_kinematics(arm, cam::pose_of(row.coordinates, numbers) * X_TF, seed).q;
    };
    const Vector3 before = truth_at(robot, joints(row.before)).translation() - row.p_B;
    const Vector3 after = truth_at(robot, joints(row.after)).translation() - row.p_B;
    errors.squares_before += before.squaredNorm();
    errors.squares += after.squaredNorm();
    errors.most_before = std::max(errors.most_before, before.norm());
    errors.most = std::max(errors.most, after.norm());
    ++errors.count;
    for (Eigen::Index k = 0; k < 3; ++k)
      errors.inside += std::abs(to_mm(after(k))) <= 1.96 * row.sigma_mm ? 1 : 0;
  }
}

void tell_errors(int models, int targets, const std::string& bias) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const std::string text = scattered(targets, 5);
  Errors all;
  for (int m = 0; m < models; ++m) {
    const CompensatedModel model = trained(robot, 100 + static_cast<std::uint64_t>(m), bias);
    const cam::Program program = cam::read_program(cam::Dialect::kRapid, {{"m.mod", text}}, {});
    add_errors(robot, model,
               test::demand(cam::correct_program(program, model.cell().robot, cli::tools_of(model),
                                                 by(model), {})),
               all);
  }
  const double n = all.count;
  const std::string as = bias == "se" ? "" : fmt::format(", bias {}", bias);
  if (bias == "se") {
    test::tell_figure("programs: true error before, rms, mm",
                      to_mm(std::sqrt(all.squares_before / n)));
    test::tell_figure("programs: true error before, max, mm", to_mm(all.most_before));
  }
  test::tell_figure("programs: true error after, rms, mm" + as, to_mm(std::sqrt(all.squares / n)));
  test::tell_figure("programs: true error after, max, mm" + as, to_mm(all.most));
  test::tell_figure("programs: true error inside the stated 95 %, %" + as,
                    100.0 * all.inside / (3 * n));
}

/// A KRL program along these places with the tool turned as in R; no configuration is said, so that
/// each target has the joints next to those before. `begin`: the joints to begin at.
std::string krl_along(const std::vector<Vector3>& p, const Matrix3& R, const JointVector& begin) {
  const std::vector<double> abc = cam::numbers_of(
      cam::Coordinates::kAnglesZyx, make_pose(R, Vector3::Zero()), std::vector<double>(6, 0.0));
  std::string text =
      "DEF P( )\n$TOOL={X 100.0,Y 0.0,Z 150.0,A 0.0,B -45.0,C 0.0}\n$BASE=$NULLFRAME\nPTP {";
  for (Eigen::Index j = 0; j < 6; ++j)
    text += fmt::format("{}A{} {:.9f}", j > 0 ? "," : "", j + 1, to_deg(begin(j)));
  text += "}\n";
  for (const Vector3& at : p) {
    text += fmt::format("LIN {{X {:.6f},Y {:.6f},Z {:.6f},A {:.9f},B {:.9f},C {:.9f}}} C_DIS\n",
                        to_mm(at.x()), to_mm(at.y()), to_mm(at.z()), abc[3], abc[4], abc[5]);
  }
  return text + "END\n";
}

constexpr double kSpacing = 0.2e-3;  // m, of neighbours

/// Largest change of the correction and of the true error from a target to the next, m; and what is
/// left.
struct Steps {
  double correction = 0, truth = 0;
  int left = 0, outside = 0, count = 0;
};

Steps steps_along(const VirtualRobot& robot, const CompensatedModel& model,
                  const std::vector<Vector3>& p, const Matrix3& R, const JointVector& begin) {
  const cam::Program program =
      cam::read_program(cam::Dialect::kKrl, {{"p.src", krl_along(p, R, begin)}}, {});
  cam::CorrectedProgram made = test::demand(
      cam::correct_program(program, model.cell().robot, cli::tools_of(model), by(model), {}));
  std::stable_sort(
      made.rows.begin(), made.rows.end(),
      [](const cam::ReceiptRow& a, const cam::ReceiptRow& b) { return a.order < b.order; });
  const Pose X_TF = model.parts().physics.tools.at("spindle").inverse();
  Steps steps;
  std::optional<Vector3> last_correction, last_error;
  JointVector q = begin;
  for (const cam::ReceiptRow& row : made.rows) {
    if (cam::is_joints(row.coordinates)) continue;
    ++steps.count;
    steps.left += row.corrected() ? 0 : 1;
    steps.outside += row.status == "out_of_domain" ? 1 : 0;
    q = inverse_kinematics(model.cell().robot, make_pose(R, row.p_B) * X_TF, q).q;
    const Vector3 error = truth_at(robot, q).translation() - row.p_B;
    if (last_error) steps.truth = std::max(steps.truth, (error - *last_error).norm());
    if (last_correction)
      steps.correction = std::max(steps.correction, (row.correction_B - *last_correction).norm());
    last_error = error;
    last_correction = row.correction_B;
  }
  return steps;
}

void tell_steps(const std::string& name, const Steps& steps) {
  constexpr double kAllowed = 1e-6;  // m, beside the share
  fmt::print(
      "{}: {} targets, {} out of domain, {} left; largest step {:.6f} mm, of the true error {:.6f} "
      "mm\n",
      name, steps.count, steps.outside, steps.left, to_mm(steps.correction), to_mm(steps.truth));
  test::tell_figure(
      fmt::format("programs: {}: largest step less 1 µm over that of the true error", name),
      std::max(0.0, steps.correction - kAllowed) / steps.truth);
  test::tell_figure(fmt::format("programs: {}: targets left", name), steps.left);
}

/// The cell whose joint 2 is measured in a smaller range.
std::shared_ptr<const Cell> narrow_cell() {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->joint_ranges[1] = {from_deg(-20), from_deg(40)};
  return cell;
}

void tell_smoothness() {
  const VirtualRobot robot = test::chapter_5_robot(narrow_cell());
  const CompensatedModel model = trained(robot, 3);
  const Chain& arm = model.cell().robot;
  const Pose X_FT = model.parts().physics.tools.at("spindle");
  JointVector stretched(6);
  stretched << 0.1, 0.2, -0.1, 0, 0, 0;
  const Pose X_BT = arm.flange_pose(stretched) * X_FT;
  for (const double beside : {0.0, 1e-3}) {
    // The circle passes the place where the wrist is stretched, or that far beside it.
    constexpr double kRadius = 0.05;
    std::vector<Vector3> circle;
    const int count = static_cast<int>(2 * kPi * kRadius / kSpacing);
    for (int i = 0; i <= count; ++i) {
      const double a = 2 * kPi * i / count + 1;
      circle.push_back(X_BT.translation() +
                       Vector3(0, kRadius * std::cos(a) - kRadius - beside, kRadius * std::sin(a)));
    }
    JointVector seed = stretched;
    seed(4) = -0.05;
    const JointVector begin =
        inverse_kinematics(arm, make_pose(X_BT.linear(), circle.front()) * X_FT.inverse(), seed).q;
    tell_steps(fmt::format("circle {:.0f} mm beside a stretched wrist", to_mm(beside)),
               steps_along(robot, model, circle, X_BT.linear(), begin));
  }
  JointVector bent(6);
  bent << 0.1, 0.6, -0.1, 0, 0.9, 0;
  const Pose X_bent = arm.flange_pose(bent) * X_FT;
  std::vector<Vector3> spiral;
  for (double a = 0, r = 0; r < 0.55;) {
    spiral.push_back(X_bent.translation() + Vector3(r * std::cos(a), r * std::sin(a), 0));
    const double along = std::hypot(r, 0.03);  // m a radian
    a += kSpacing / along;
    r = 0.03 * a;
  }
  tell_steps("spiral across the edge of the domain",
             steps_along(robot, model, spiral, X_bent.linear(), bent));
}

/// Of the RAPID programs that tests correct; and of tools that differ from the cell's, how many are
/// refused.
void tell_share() {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const CompensatedModel model = trained(robot, 1);
  std::size_t moves = 0, corrected = 0, reasons = 0, left = 0, refused = 0, programs = 0;
  for (const auto& folder :
       fs::directory_iterator(TRAMMEL_SOURCE_DIR "/tests/clients/programs/rapid")) {
    std::vector<cam::SourceFile> files;
    for (const auto& file : fs::directory_iterator(folder.path()))
      files.push_back(
          {file.path().filename().string(), read_text_file(file.path().string()).value()});
    const auto run = [&] {
      const cam::Program program = cam::read_program(cam::Dialect::kRapid, files, {});
      return cam::correct_program(program, model.cell().robot, cli::tools_of(model), by(model), {});
    };
    const cam::CorrectedProgram made = test::demand(run());
    moves += made.moves;
    corrected += made.moves_corrected;
    for (const cam::ReceiptRow& row : made.rows) {
      if (row.corrected()) continue;
      ++left;
      reasons += row.message.empty() ? 0u : 1u;
    }
    ++programs;
    for (cam::SourceFile& file : files) {
      if (const std::size_t at = file.text.find("[[100,0,150]"); at != std::string::npos)
        file.text.replace(at, 12, "[[100,0,151]");
    }
    refused += run() ? 0u : 1u;
  }
  test::tell_figure("programs: RAPID motions corrected, %",
                    100.0 * static_cast<double>(corrected) / static_cast<double>(moves));
  test::tell_figure(
      "programs: what is left has a reason, %",
      left == 0 ? 100.0 : 100.0 * static_cast<double>(reasons) / static_cast<double>(left));
  test::tell_figure("programs: tool data of another tool refused, %",
                    100.0 * static_cast<double>(refused) / static_cast<double>(programs));
}

struct Cost {
  double seconds = 0, processor_seconds = 0, megabytes = 0;
};

double processor_seconds(const rusage& used) {
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

/// The cost of work in a process of its own.
Cost cost_of(const std::function<int()>& work) {
  const auto begun = std::chrono::steady_clock::now();
  const pid_t child = ::fork();
  if (child == 0) ::_exit(work());
  int status = 0;
  rusage used{};
  if (child < 0 || ::wait4(child, &status, 0, &used) != child || !WIFEXITED(status) ||
      WEXITSTATUS(status) > 1)
    std::abort();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count(),
          processor_seconds(used), static_cast<double>(used.ru_maxrss) / 1024};
}

void tell_cost(int targets) {
  const test::TemporaryFolder folder;
  std::string model, program;
  // A child inherits what this process holds: so another process trains.
  static_cast<void>(cost_of([&] {
    folder.write("cell.model", serialize(trained(test::chapter_5_robot(test::cell_7()), 1)));
    folder.write("m.mod", contour(targets));
    return 0;
  }));
  model = folder.file("cell.model");
  program = folder.file("m.mod");
  const Cost alone = cost_of([&] {
    const CompensatedModel loaded = load_model(model).value();
    const cam::Program read =
        cam::read_program(cam::Dialect::kRapid, {{"m.mod", read_text_file(program).value()}}, {});
    std::vector<exchange::AskedTarget> asked;
    const cam::AskCorrections note = [&](const std::string&, const std::string&,
                                         const std::vector<exchange::AskedTarget>& all)
        -> Result<exchange::Answer<exchange::CorrectedTarget>> {
      asked = all;
      return refused("only asked");
    };
    static_cast<void>(
        cam::correct_program(read, loaded.cell().robot, cli::tools_of(loaded), note, {}));
    rusage before{}, after{};
    ::getrusage(RUSAGE_SELF, &before);
    for (const exchange::AskedTarget& one : asked) {
      if (loaded.correct(target_of(one, loaded.cell().robot), "spindle", "spindle").q.size() != 6)
        return 2;
    }
    ::getrusage(RUSAGE_SELF, &after);
    folder.write("took", fmt::format("{}", processor_seconds(after) - processor_seconds(before)));
    return 0;
  });
  static_cast<void>(alone);
  const double evaluation = std::stod(read_text_file(folder.file("took")).value());
  const Cost all = cost_of([&] {
    const std::string out = folder.file("out.mod"), receipt = folder.file("r.csv");
    const std::vector<const char*> argv = {"trammel",     "correct",       "--model",
                                           model.c_str(), program.c_str(), "-o",
                                           out.c_str(),   "--receipt",     receipt.c_str()};
    return cli::run_command_line(static_cast<int>(argv.size()), argv.data());
  });
  fmt::print(
      "{} targets: {:.2f} s, {:.2f} s of processors, {:.2f} s of them the evaluation alone takes\n",
      targets, all.seconds, all.processor_seconds, evaluation);
  test::tell_figure("programs: 100,000 targets, processor time over that of the evaluation alone",
                    all.processor_seconds / evaluation);
  test::tell_figure(
      "programs: 100,000 targets, time over the processor time of the evaluation alone",
      all.seconds / evaluation);
  test::tell_figure("programs: 100,000 targets, memory, MB", all.megabytes);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What programs become, on the virtual robot.");
  int models = 40, targets = 500, dense = 100000;
  std::string only;
  app.add_option("--models", models);
  app.add_option("--targets", targets);
  app.add_option("--dense", dense);
  app.add_option("--only", only);
  CLI11_PARSE(app, argc, argv);
  if (only.empty() || only == "cost") trammel::tell_cost(dense);
  if (only.empty() || only == "share") trammel::tell_share();
  if (only.empty() || only == "smooth") trammel::tell_smoothness();
  for (const char* bias : {"se", "auto"}) {
    if (only.empty() || only == "errors") trammel::tell_errors(models, targets, bias);
  }
  return 0;
}
