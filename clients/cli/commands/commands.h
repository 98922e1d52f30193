#pragma once

#include <concepts>
#include <functional>
#include <type_traits>
#include <utility>

#include "server/base/result.h"

namespace CLI {
class App;
}

/// The commands, a file a group. Each add function adds its commands to `app`; the action of the
/// one that the command line names is put into `chosen`.
namespace trammel::cli {

/// The completed part of a command's task. For kPart it has printed the missing part on standard
/// error.
enum class Extent { kAll, kPart };

/// The commands of the command line. Commands that do all or nothing answer a Status.
class Action {
 public:
  Action() = default;
  template <typename Work>
  requires(!std::same_as<Work, Action>)
      Action(Work work)  // NOLINT(google-explicit-constructor): a lambda is one
      : work_([work = std::move(work)]() -> Result<Extent> {
          if constexpr (std::same_as<std::invoke_result_t<const Work&>, Status>) {
            return work().map([] { return Extent::kAll; });
          } else {
            return work();
          }
        }) {}

  [[nodiscard]] explicit operator bool() const { return static_cast<bool>(work_); }
  [[nodiscard]] Result<Extent> operator()() const { return work_(); }

 private:
  std::function<Result<Extent>()> work_;
};

void add_plan_command(CLI::App& app, Action& chosen);
void add_pose_commands(CLI::App& app, Action& chosen);         // simulate
void add_measurement_commands(CLI::App& app, Action& chosen);  // convert, references
void add_structure_commands(CLI::App& app, Action& chosen);    // cpa, deflection
void add_model_commands(CLI::App& app, Action& chosen);        // train, evaluate, report
void add_apply_commands(CLI::App& app, Action& chosen);        // predict, correct
void add_backup_command(CLI::App& app, Action& chosen);        // import-backup
void add_setup_command(CLI::App& app, Action& chosen);
void add_store_backup_command(CLI::App& app, Action& chosen);  // backup
void add_store_command(CLI::App& app, Action& chosen);
void add_robot_command(CLI::App& app, Action& chosen);    // export-robot
void add_confirm_command(CLI::App& app, Action& chosen);  // confirm-robot
void add_doctor_command(CLI::App& app, Action& chosen);
/// Adds help, completion and manual, which describe `app` as it is when they run; it outlives
/// `chosen`.
void add_help_commands(CLI::App& app, Action& chosen);
void add_view_command(CLI::App& app, Action& chosen);
void add_check_command(CLI::App& app, Action& chosen);
void add_remedies_command(CLI::App& app, Action& chosen);
void add_compare_command(CLI::App& app, Action& chosen);
void add_fleet_command(CLI::App& app, Action& chosen);
void add_diagnose_command(CLI::App& app, Action& chosen);
void add_study_command(CLI::App& app, Action& chosen);
void add_audit_command(CLI::App& app, Action& chosen);
void add_replay_command(CLI::App& app, Action& chosen);
void add_history_command(CLI::App& app, Action& chosen);
void add_service_commands(CLI::App& app,
                          Action& chosen);  // submit, retrain, status, watch, models, ...

}  // namespace trammel::cli
