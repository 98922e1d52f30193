#include "server/gateway/routes.h"

#include <sstream>
#include <string_view>

namespace trammel {
namespace {

constexpr const char* kPageType = "text/html";
constexpr const char* kFile = "application/octet-stream";

const RouteOption kChange{"change_id", "string", false,
                          "unique for ever: the change happens once, however often it is sent"};
const RouteOption kBatch{"batch_id", "string", false, "of a stored batch, or of the one sent"};
const RouteOption kTool{"tool", "string", false, "of the cell; left out: its only one"};
const RouteOption kPayload{"payload", "string", false, "of the cell; left out: its only one"};

std::vector<std::string> words_of_path(const char* path) {
  std::vector<std::string> words = {"api", "v1"};
  std::istringstream text(path);
  for (std::string word; std::getline(text, word, '/');) {
    if (!word.empty()) words.push_back(word);
  }
  return words;
}

bool fits(const Route& route, const std::vector<std::string>& words, FoundRoute& found) {
  const std::vector<std::string> pattern = words_of_path(route.path);
  if (pattern.size() != words.size()) return false;
  found = {&route, {}, {}};
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (pattern[i] == "{cell}") {
      found.cell = words[i];
    } else if (pattern[i] == "{job}") {
      found.job = words[i];
    } else if (pattern[i] != words[i]) {
      return false;
    }
  }
  return true;
}

std::vector<Route> routes_that_read() {
  return {{Endpoint::kPage,
           "GET",
           "/",
           Role::kObserver,
           "a page where a program is dropped",
           "",
           kPageType,
           {}},
          {Endpoint::kOpenApi,
           "GET",
           "/openapi.json",
           Role::kObserver,
           "this description",
           "",
           "application/json",
           {}},
          {Endpoint::kStatus,
           "GET",
           "/status",
           Role::kObserver,
           "all cells and servers, as `trammel fleet --json`",
           "",
           "application/json Status",
           {}},
          {Endpoint::kJobs,
           "GET",
           "/jobs",
           Role::kObserver,
           "the unfinished jobs and the last finished ones, oldest first",
           "",
           "application/json Jobs",
           {{"cell", "string", false, "only those of this cell"}}},
          {Endpoint::kJob,
           "GET",
           "/jobs/{job}",
           Role::kObserver,
           "one job",
           "",
           "application/json Job",
           {}},
          {Endpoint::kFindings,
           "GET",
           "/cells/{cell}/jobs/{job}/findings",
           Role::kObserver,
           "what a diagnosis or a check found",
           "",
           "application/json Findings",
           {}},
          {Endpoint::kModels,
           "GET",
           "/cells/{cell}/models",
           Role::kObserver,
           "the versions of a cell, oldest first",
           "",
           "application/json Models",
           {}}};
}

std::vector<Route> routes_for_programs() {
  return {{Endpoint::kPredict,
           "POST",
           "/cells/{cell}/predict",
           Role::kCam,
           "the error to expect at commanded joints",
           "application/json PredictRequest",
           "application/json Predictions",
           {}},
          {Endpoint::kCorrect,
           "POST",
           "/cells/{cell}/correct",
           Role::kCam,
           "what to command so that the tool lands where it is wanted",
           "application/json CorrectRequest",
           "application/json Corrections",
           {}},
          {Endpoint::kProgram,
           "POST",
           "/cells/{cell}/program",
           Role::kCam,
           "one file of a robot program, corrected byte for byte",
           kFile,
           kFile,
           {{"name", "string", true, "of the file; its ending says the kind"},
            {"format", "string", false, "the kind, where the ending does not say it"},
            kTool,
            kPayload,
            {"keep_digits", "boolean", false, "numbers keep their decimals"}}},
          {Endpoint::kPrograms,
           "POST",
           "/cells/{cell}/programs",
           Role::kCam,
           "a robot program of one or more files, corrected byte for byte, with its receipt",
           "application/json ProgramRequest",
           "application/json Program",
           {}}};
}

std::vector<Route> routes_that_change() {
  return {{Endpoint::kSubmit,
           "POST",
           "/cells/{cell}/batches",
           Role::kMetrologist,
           "takes a batch and trains from it; accepted means stored",
           "text/csv",
           "application/json Queued",
           {{"batch_id", "string", true, "unique within the cell, for ever"}, kChange}},
          {Endpoint::kCheck,
           "POST",
           "/cells/{cell}/check",
           Role::kMetrologist,
           "holds a few poses against the model in force",
           "text/csv",
           "application/json Queued",
           {{"tolerance_mm", "number", false, "left out: as the cell file says"}, kBatch, kChange}},
          {Endpoint::kDiagnose,
           "POST",
           "/cells/{cell}/diagnose",
           Role::kMetrologist,
           "looks for causes, applies nothing",
           "text/csv",
           "application/json Queued",
           {kBatch, kChange}},
          {Endpoint::kActivate,
           "POST",
           "/cells/{cell}/activate",
           Role::kEngineer,
           "puts a version in force",
           "application/json ActivateRequest",
           "application/json Model",
           {}},
          {Endpoint::kRollback,
           "POST",
           "/cells/{cell}/rollback",
           Role::kEngineer,
           "puts the version in force that was in force before",
           "application/json RollbackRequest",
           "application/json Model",
           {}},
          {Endpoint::kTrain,
           "POST",
           "/cells/{cell}/train",
           Role::kEngineer,
           "trains again from stored batches",
           "application/json TrainRequest",
           "application/json Queued",
           {}}};
}

}  // namespace

const std::vector<Route>& routes() {
  static const std::vector<Route> kRoutes = [] {
    std::vector<Route> all = routes_that_read();
    for (const auto& more : {routes_for_programs(), routes_that_change()})
      all.insert(all.end(), more.begin(), more.end());
    return all;
  }();
  return kRoutes;
}

std::optional<FoundRoute> find_route(const std::string& method,
                                     const std::vector<std::string>& words) {
  std::optional<FoundRoute> of_another_method;
  for (const Route& route : routes()) {
    FoundRoute found;
    if (!fits(route, words, found)) continue;
    if (method == route.method) return found;
    of_another_method = found;
  }
  return of_another_method;
}

}  // namespace trammel
