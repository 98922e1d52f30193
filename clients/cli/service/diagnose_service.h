#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"

namespace trammel::cli {

/// The arguments of `trammel diagnose`.
struct DiagnoseArguments {
  std::string cell, report, next_poses, json, model, cell_out, since;
  std::vector<std::string> batches;  ///< at most one for a service
  std::uint64_t seed = 1;
  bool apply = false, strict = false, prove = false;
  double prove_minutes = 10;
  ServiceOptions service;
};

/// Text for people, left out where a result goes to standard output.
void say(const std::string& text, const DiagnoseArguments& arguments);

/// Page, next poses and JSON, as far as they are requested.
[[nodiscard]] Outputs outputs_of(const DiagnoseArguments& arguments);
/// Writes the findings and the other `outputs`; explains missing next poses.
[[nodiscard]] Status write_diagnosis(const nlohmann::ordered_json& json, std::string page,
                                     Outputs& outputs, const DiagnoseArguments& arguments);

/// True if --strict requires a complete model and this one lacks a cause, which it reports on
/// standard error.
[[nodiscard]] bool leaves_open(const nlohmann::ordered_json& json,
                               const DiagnoseArguments& arguments);

/// Makes a service diagnose one of its batches (`batches` names it; none: the newest) or a file,
/// waits, and writes the findings. Returns false if the result should have gone in force and did
/// not, or if it leaves_open().
[[nodiscard]] Result<bool> diagnose_at_service(const DiagnoseArguments& arguments);

}  // namespace trammel::cli
