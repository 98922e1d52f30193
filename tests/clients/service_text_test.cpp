#include "clients/cli/text/service_text.h"

#include <gtest/gtest.h>

namespace trammel::cli {
namespace {

client::DatedJob job(std::int64_t number, const std::string& stage, const std::string& what) {
  client::DatedJob job;
  job.status = {number, "cell-7", stage, what, 0.4, 0, false};
  job.server = "a";
  job.kind = "train";
  job.batches = {"lt-07"};
  job.created_unix_s = 1'700'000'000;
  return job;
}

TEST(ServiceText, JobsThatRunWaitAndFailedAreShownWithReasonAndDates) {
  client::DatedJob failed = job(1, "failed", "too few rows");
  failed.started_unix_s = 1'700'000'060;
  failed.finished_unix_s = 1'700'003'600;
  const std::string text =
      jobs_text({failed, job(2, "done", "old"), job(3, "done", "in force: better"),
                 job(4, "training", "learning the bias"), job(5, "queued", "")});
  EXPECT_EQ(
      text,
      "job 4 of cell cell-7 (training of lt-07) training 40 %, accepted 2023-11-14 22:13: learning "
      "the bias\n"
      "job 5 of cell cell-7 (training of lt-07) queued, accepted 2023-11-14 22:13\n"
      "job 3 of cell cell-7 (training of lt-07) done, accepted 2023-11-14 22:13: in force: better\n"
      "job 1 of cell cell-7 (training of lt-07) failed, accepted 2023-11-14 22:13, begun "
      "2023-11-14 22:14, ended 2023-11-14 23:13: too few rows\n");
  EXPECT_EQ(jobs_text({}), "no job runs or waits\n");
  EXPECT_EQ(jobs_json({failed})[0]["finished_unix_s"], 1'700'003'600);
  EXPECT_TRUE(jobs_json({job(5, "queued", "")})[0]["started_unix_s"].is_null());
}

TEST(ServiceText, HowAJobEndedIsNotWhatIsInForceNow) {
  client::JobStatus job = {1, "cell-7", "done", "in force: better", 1, 1, true};
  job.verdict = "in_force";
  EXPECT_EQ(ended_text(job), "job 1 of cell cell-7 done: version 1, in force\nin force: better\n");
  job.in_force = false;
  EXPECT_TRUE(put_in_force(job));
  EXPECT_EQ(next_step(job), "");
  EXPECT_EQ(ended_text(job),
            "job 1 of cell cell-7 done: version 1, was put in force, and another version is in "
            "force now\n"
            "when it ended: in force: better\n");
  job.verdict = "not_better";
  job.what = "not in force: worse";
  EXPECT_FALSE(put_in_force(job));
  EXPECT_EQ(ended_text(job),
            "job 1 of cell cell-7 done: version 1, not in force\nnot in force: worse\n");
  job.in_force = true;
  EXPECT_FALSE(put_in_force(job));
  EXPECT_EQ(
      ended_text(job),
      "job 1 of cell cell-7 done: version 1, was not put in force by the job, and is in force now\n"
      "when it ended: not in force: worse\n");
  job.verdict = "open";
  EXPECT_TRUE(put_in_force(job)) << "a job from before verdicts were kept";
}

TEST(ServiceText, AJobSaysForProgramsWhyAPersonDecides) {
  client::JobStatus job = {1, "cell-7", "done", "not in force: few poses", 1, 1, false};
  EXPECT_EQ(job_json(job)["held_back"], "") << "nobody need decide";
  job.held_back = "stop_note";
  EXPECT_EQ(job_json(job)["held_back"], "stop_note");
}

TEST(ServiceText, ServersThatSayDifferentThingsOfABatchAreNamed) {
  client::BatchOfService one{"cell-7", "lt-07", "", 60, 0, "", true, "a"};
  client::BatchOfService other = one;
  EXPECT_EQ(batches_text({one, other}).find("server"), std::string::npos);
  other.server = "b";
  other.learned = false;
  const std::string text = batches_text({one, other});
  EXPECT_NE(text.find("\na       cell-7  lt-07"), std::string::npos) << text;
  EXPECT_NE(text.find("\nb       cell-7  lt-07"), std::string::npos) << text;
  EXPECT_EQ(batches_json({one, other})[1]["server"], "b");
}

TEST(ServiceText, AJobThatBeginsSaysWhatHappensNextAndTheCommandsThatShowIt) {
  const std::string text = started_text("cell-7", 12);
  EXPECT_TRUE(text.starts_with("job 12\n")) << text;
  EXPECT_NE(text.find("trammel watch 12"), std::string::npos) << text;
  EXPECT_NE(text.find("trammel models cell-7"), std::string::npos) << text;
}

TEST(ServiceText, JobsOfATableSayHowTheyEnded) {
  const std::string text = all_jobs_text({job(1, "failed", "too few rows")});
  EXPECT_NE(text.find("  1  cell-7  training  failed  2023-11-14 22:13  lt-07    too few rows\n"),
            std::string::npos)
      << text;
  EXPECT_NE(all_jobs_text({job(1, "failed", "")}, TableForm::kWide).find("server"),
            std::string::npos);
}

TEST(ServiceText, AModelsDatesAreThoseOfItsTrainingAndOfItsData) {
  exchange::ModelInfo model;
  model.cell = "cell-7";
  model.version = 2;
  model.trained_at_unix_s = 1'700'000'000;
  model.measured_at_unix_s = 1'699'917'200;
  EXPECT_NE(models_text({model}).find("2023-11-14 22:13  2023-11-13 23:13"), std::string::npos)
      << models_text({model});
  model.level = "base,gear_transmission:3@48.5";
  EXPECT_NE(models_text({model}, TableForm::kWide).find("base position, gear ripple in joint 3\n"),
            std::string::npos);
  EXPECT_EQ(models_json({model})[0]["level"], model.level) << "programs read the spelling";
  model.measured_at_unix_s.reset();
  EXPECT_NE(models_text({model}).find("2023-11-14 22:13  -  "), std::string::npos)
      << "nobody recorded it";
  EXPECT_TRUE(models_json({model})[0]["data_age_s"].is_null());
}

TEST(ServiceText, AModelsGraveNotesStandUnderTheTableAndProgramsGetAllOfThem) {
  exchange::ModelInfo model;
  model.cell = "cell-7";
  model.version = 2;
  model.notes = {
      {"robot_off_drawing", Note::Severity::kStop, "The robot file is not the controller's."},
      {"robot_not_confirmed", Note::Severity::kInfo, "Nobody compared it."}};
  const std::string text = models_text({model});
  EXPECT_NE(text.find("\ncell-7@2: stop: The robot file is not the controller's.\n"),
            std::string::npos)
      << text;
  EXPECT_EQ(text.find("Nobody compared it."), std::string::npos) << text;
  const auto notes = models_json({model})[0]["notes"];
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_EQ(notes[0]["severity"], "stop");
  EXPECT_EQ(notes[1]["code"], "robot_not_confirmed");
}

TEST(ServiceText, OfAModelInForceTheWholeErrorOfTheDrawingAndWhereTheRestOfTheBudgetStands) {
  exchange::ModelInfo model;
  model.cell = "cell-7";
  model.version = 2;
  model.budget = {"the drawing is off by 21.100 mm rms at 120 poses", "the zero of joint 4"};
  EXPECT_EQ(models_text({model}).find("21.100"), std::string::npos) << "it is not in force";
  model.in_force = true;
  EXPECT_TRUE(
      models_text({model}).ends_with("cell-7@2: the drawing is off by 21.100 mm rms at 120 "
                                     "poses (trammel show cell-7)\n"))
      << models_text({model});
  EXPECT_EQ(models_json({model})[0]["budget"]["sentences"].size(), 2u);
}

TEST(ServiceText, AnActivationSaysBeforeAfterLimitWhyAndTheNextCommand) {
  const nlohmann::ordered_json said = {
      {"version", 2},
      {"before_mm", 0.0112},
      {"after_mm", 0.0251},
      {"limit_mm", 0.0114},
      {"why", "when it was made: worse"},
      {"next", "trammel rollback --service --cell cell-7 puts version 1 back in force"}};
  EXPECT_EQ(in_force_text(in_force_json("cell-7", 2, said)),
            "cell cell-7: version 2 in force\n"
            "held-out rms: before 0.0112 mm, after 0.0251 mm, limit 0.0114 mm\n"
            "why: when it was made: worse\n"
            "next: trammel rollback --service --cell cell-7 puts version 1 back in force, if it is "
            "not wanted\n");
  EXPECT_EQ(in_force_json("cell-7", 2, said)["after_mm"], 0.0251);
  const auto another = in_force_json("cell-7", 4, said);
  EXPECT_TRUE(another["after_mm"].is_null()) << "the figures are of another version";
  EXPECT_NE(in_force_text(another).find("never held against"), std::string::npos)
      << in_force_text(another);
  EXPECT_EQ(in_force_json("cell-7", 4, nullptr)["next"], "");
  EXPECT_EQ(in_force_json("cell-7", 4, {{"version", 4}, {"why", 7}, {"after_mm", "x"}})["after_mm"],
            nullptr);
}

TEST(ServiceText, WhatIsNotInForceComesWithTheNextCommand) {
  client::JobStatus end{3, "cell-7", "done", "not in force: worse", 1, 4, false};
  EXPECT_NE(next_step(end).find("trammel activate cell-7@4"), std::string::npos);
  end.in_force = true;
  EXPECT_EQ(next_step(end), "");
  EXPECT_EQ(next_step({3, "cell-7", "done", "nothing", 1, 0, false}), "") << "a diagnosis";
  client::JobStatus kept_out{3, "cell-7", "failed", "batch b: another tool", 0, 0, false};
  kept_out.verdict = "quarantined";
  EXPECT_NE(next_step(kept_out).find("--release"), std::string::npos);
  client::JobStatus failed{3, "cell-7", "failed", "a file called quarantine.csv is missing",
                           0, 0,        false};
  failed.verdict = "refused";
  EXPECT_EQ(next_step(failed), "") << "words decide nothing";
  failed.next = "measure more poses";
  EXPECT_EQ(next_step(failed), "next: measure more poses");
}

TEST(ServiceText, ServersOfARecordThatDoNotAnswerClientsAreListedBesideThoseThatDo) {
  auto servers = nlohmann::ordered_json::parse(
      R"([{"server": "a", "serves": true, "trains": true, "reachable": true}])");
  add_other_servers(nlohmann::ordered_json::parse(
                        R"([{"server": "a", "serves": true, "trains": true, "gone": false},
      {"server": "b", "serves": false, "trains": true, "gone": false},
      {"server": "c", "serves": true, "trains": false, "gone": true}, {"server": 7}, 3])"),
                    servers);
  ASSERT_EQ(servers.size(), 3u);
  EXPECT_EQ(servers[1].dump(), R"({"server":"b","serves":false,"trains":true,"reachable":true})");
  EXPECT_EQ(servers[2].dump(), R"({"server":"c","serves":true,"trains":false,"reachable":false})");
  add_other_servers(nullptr, servers);
  EXPECT_EQ(servers.size(), 3u);
}

TEST(ServiceText, TheServersOfARecordAreThereBehindOrGone) {
  using nlohmann::ordered_json;
  const ordered_json record = {
      {"kind", "postgresql"}, {"place", "postgresql://db/trammel"}, {"reachable", true}};
  ordered_json one = {{"server", "one"}, {"host", "h1"},       {"version", "0.1.0"},
                      {"pid", 7},        {"serves", true},     {"trains", true},
                      {"gone", false},   {"changes_behind", 0}};
  one["cells"] = {{{"cell", "cell-7"}, {"version", 3}},
                  {{"cell", "cell-8"}, {"version", 0}, {"why", "other files"}}};
  ordered_json two = {{"server", "two"}, {"host", "h2"},       {"version", "0.1.0"},
                      {"pid", 8},        {"serves", false},    {"trains", true},
                      {"gone", false},   {"changes_behind", 2}};
  two["works_on"] = {{{"job", 4}, {"cell", "cell-7"}}};
  const ordered_json gone = {{"server", "three"},
                             {"host", "h3"},
                             {"gone", true},
                             {"heard_unix_s", 1'700'000'000},
                             {"silent_s", 60}};
  EXPECT_EQ(servers_text({one, two, gone}, record),
            "servers of the record:\n"
            "  one on h1 (0.1.0, process 7): serves 1 cell, trains, up to date\n"
            "    other files\n"
            "  two on h2 (0.1.0, process 8): trains, works on job 4 of cell-7, 2 changes behind\n"
            "  three on h3: gone, not heard of since 2023-11-14 22:13 UTC (60 s)\n");
  EXPECT_EQ(servers_text(nullptr, record),
            "which servers are there, and their jobs, is not known while the record is away\n");
  EXPECT_EQ(servers_text({one}, {{"kind", "sqlite"}}), "");
  EXPECT_EQ(servers_text({1, "x"}, record).substr(0, 23), "servers of the record:\n")
      << "whatever a server says";
}

}  // namespace
}  // namespace trammel::cli
