#pragma once

#include <functional>

#include "server/base/result.h"

namespace CLI {
class App;
}

/// The commands, a file a group. Each add function adds its commands to `app`; the action of the one that the command
/// line names is put into `chosen`.
namespace trammel::cli {

using Action = std::function<Status()>;

void add_plan_command(CLI::App& app, Action& chosen);
void add_pose_commands(CLI::App& app, Action& chosen);         // simulate
void add_measurement_commands(CLI::App& app, Action& chosen);  // convert, references
void add_structure_commands(CLI::App& app, Action& chosen);    // cpa, deflection
void add_model_commands(CLI::App& app, Action& chosen);        // train, evaluate, report
void add_apply_commands(CLI::App& app, Action& chosen);        // predict, correct
void add_diagnose_command(CLI::App& app, Action& chosen);
void add_study_command(CLI::App& app, Action& chosen);
void add_service_commands(CLI::App& app, Action& chosen);  // submit, retrain, status, watch, models, ...

}  // namespace trammel::cli
