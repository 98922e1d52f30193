#include "clients/cli/terminal/help_topics.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

namespace trammel::cli {

namespace {

constexpr std::array kTopics = {
    HelpTopic{
        "start", "from nothing to a corrected program, in five commands",
        "From a program or a backup of the controller, trammel setup FOLDER -o cell-7 writes the "
        "cell file and a plan. Then:\n"
        "\n"
        "Plan measuring poses, measure them, train a model, look at it, correct a program:\n"
        "  trammel plan cell.yaml --count 60 -o plan.csv --rapid plan.mod\n"
        "  trammel convert --points tracker.txt --joints plan.csv -o batch.csv\n"
        "  trammel train cell.yaml batch.csv -o cell.model\n"
        "  trammel report cell.model -o report.html\n"
        "  trammel correct cell.model drill.mod -o drill-corrected.mod\n"
        "\n"
        "What cell.yaml says: trammel help cell. What batch.csv holds: trammel help formats.\n"
        "Without a robot at hand: trammel simulate measures a plan on a virtual one."},
    HelpTopic{"formats", "the columns of every table that is read",
              "All tables are text in columns with a header line: separated by ',', ';' or tabs, "
              "as the header is. With ';' or tabs numbers may have decimal commas. Names of "
              "columns may be in capitals. Spreadsheets (.xlsx) are exported first: Save As, \"CSV "
              "UTF-8\". What may be read in two ways is refused.\n"
              "\n"
              "Batch, what was measured (train, evaluate, diagnose, check, submit):\n"
              "  q1_deg ... qn_deg     joints as commanded, deg; a rail has q7_mm\n"
              "  x_mm, y_mm, z_mm      tool position as measured, mm\n"
              "  qw, qx, qy, qz        optional: orientation, unit quaternion, w first\n"
              "  pose_id, time_s, sigma_mm, temperature_c, tool_id, payload_id,\n"
              "  dir1 ... dirn (-1, 0, 1), session_id, set (train, validation)\n"
              "\n"
              "Joints, what is to be commanded (plan, predict --joints, simulate --plan):\n"
              "  q1_deg ... qn_deg, and any of pose_id, tool_id, payload_id, dir1 ...\n"
              "\n"
              "Targets (correct):\n"
              "  x_mm, y_mm, z_mm, qw, qx, qy, qz   tool in the robot's base\n"
              "  conf, or q1_deg ...                the branch, or joints near by\n"
              "\n"
              "Points of a tracker (convert, references):\n"
              "  name, x_mm, y_mm, z_mm             or a SpatialAnalyzer ASCII export"},
    HelpTopic{"cell", "what a cell file says",
              "YAML. The shortest one:\n"
              "  version: 1\n"
              "  cell: cell-7\n"
              "  robot: ../models/abb_irb6640-205-275.yaml   # relative to this file\n"
              "  base: null                        # unknown: found from the data\n"
              "  gravity: [0, 0, -1]\n"
              "  tools: {spindle: null}            # unknown: found from the data\n"
              "  tracker: {sigma_mm: 0.013}\n"
              "  model: {error_sources: [base, geometry, compliance], bias: se}\n"
              "\n"
              "Unknown keys are refused, all problems of a file are said in one run. trammeld "
              "--check looks at a server file and at all of its cells."},
    HelpTopic{
        "units", "in which unit each number is",
        "Joints are in deg, rails in mm, positions in mm, weights in kg, forces in N, times in s, "
        "temperatures in degrees Celsius. The name of a column or key ends in its unit: q1_deg, "
        "x_mm, mass_kg. u95 is two standard uncertainties; sigma_mm is one, per axis."},
    HelpTopic{
        "levels", "what a training identifies (--level, --bias)",
        "M0 nothing, M1 base, M2 base and geometry, M3 base, geometry and compliance; a list, or a "
        "level and more:\n"
        "  trammel train c.yaml b.csv --level M2,gear_transmission:3 -o m\n"
        "With auto the measurements choose what is added to base, geometry and tools, and train "
        "tells what was tried: --level auto, or model: {error_sources: auto} in the cell file.\n"
        "\n"
        "--bias spells the kernel of what is learned of the rest: se, matern32, matern52, none, "
        "auto, sums and products of them. An \"rbf\" kernel of other programs is called se here."},
    HelpTopic{"service", "asking a daemon, and which one (--port, --host)",
              "With --service, or for commands that only a daemon can do, trammel asks a running "
              "trammeld on this host:\n"
              "  trammeld --config config/server.yaml --check\n"
              "  deploy/supervise trammeld --config config/server.yaml\n"
              "  trammel status\n"
              "\n"
              "It looks at --host 127.0.0.1, --port 17500, --domain 0. Once --port for each "
              "server. Where a discovery server runs (dds: discovery_servers of the server file), "
              "--discovery-server HOST instead: it tells where services are. trammel doctor says "
              "what is in the way where nothing answers."},
    HelpTopic{"defaults", "one file for what you would say every time",
              "The file that the environment variable TRAMMEL_DEFAULTS names, else "
              "~/.config/trammel/defaults, holds options as name = value, one a line; # begins a "
              "comment:\n"
              "  port = 17501\n"
              "  cell = /data/cells/cell-7.yaml\n"
              "\n"
              "Taken are host, discovery-server, port, domain, timeout, cell, tool, payload and "
              "seed, by each command that has the option, cell only where a command needs one. "
              "What the command line says comes first. TRAMMEL_DEFAULTS= (empty) takes none."},
    HelpTopic{"exit-codes", "what a script may rely on",
              "0 done; 1 done but not all (targets left as they were, a new model not in force, "
              "findings of doctor, and of diagnose and check where --strict asks); 2 wrong usage; "
              "3 refused data; 4 service unreachable or busy. With --json - a refusal is JSON too: "
              "{\"error\": {code, message, file, row, field, value, limit, next, sentence}}."},
};

constexpr std::pair<std::string_view, std::string_view> kExamples[] = {
    {"plan",
     "  trammel plan cell.yaml --count 60 -o plan.csv --rapid plan.mod\n"
     "  trammel plan cell.yaml --check 12 -o check.csv\n"
     "  trammel plan cell.yaml --count 40 --criterion observability -o p.csv"},
    {"simulate", "  trammel simulate cell.yaml --truth truth.yaml --plan plan.csv -o b.csv"},
    {"convert",
     "  trammel convert --points tracker.txt --joints plan.csv -o batch.csv\n"
     "  trammel convert --robodk calibration.csv -o batch.csv"},
    {"references", "  trammel references --nominal refs.csv --measured now.csv"},
    {"cpa", "  trammel cpa --robot robot.yaml --arcs arcs.csv"},
    {"deflection", "  trammel deflection --data loads.csv"},
    {"train",
     "  trammel train cell.yaml batch.csv -o cell.model\n"
     "  trammel train cell.yaml mon.csv tue.csv --level M3 -o m\n"
     "  trammel train tool.yaml few.csv --from m --refit tool -o m2"},
    {"evaluate", "  trammel evaluate cell.model fresh.csv --json -"},
    {"report",
     "  trammel report cell.model fresh.csv -o report.html\n"
     "  trammel report cell-7@3 -o report.html"},
    {"predict",
     "  trammel predict cell.model --joints plan.csv -o where.csv\n"
     "  trammel predict cell.model drill.mod -o where.csv"},
    {"correct",
     "  trammel correct cell.model targets.csv -o corrected.csv\n"
     "  trammel correct cell.model drill.mod -o out.mod --receipt r.csv\n"
     "  trammel correct cell.model drill.mod -o out.mod --lead-in --tolerance 0.1\n"
     "  trammel correct --undo out.mod -o drill.mod"},
    {"check", "  trammel check cell.model few.csv --json health.json"},
    {"diagnose",
     "  trammel diagnose cell.yaml batch.csv --report page.html\n"
     "  trammel diagnose cell.yaml b.csv --next-poses next.csv\n"
     "  trammel diagnose cell.yaml b.csv --prove --report page.html"},
    {"view",
     "  trammel view cell.yaml -o cell.html\n"
     "  trammel view cell.yaml plan.csv -o plan.html\n"
     "  trammel view cell.yaml drill.mod -o drill.html"},
    {"remedies", "  trammel remedies cell.model -o remedies.html"},
    {"compare",
     "  trammel compare a.model b.model --batch fresh.csv --report page.html\n"
     "  trammel compare cell-7@2 cell-7@3"},
    {"study", "  trammel study drilling --json -"},
    {"fleet", "  trammel fleet --model a.model --model b.model --model c.model"},
    {"setup",
     "  trammel setup BACKUP -o cell-7\n"
     "  trammel setup PROGRAM -o cell-7 --robot robot.yaml --tool spindle"},
    {"import-backup",
     "  trammel import-backup BACKUP -o cell.yaml\n"
     "  trammel import-backup BACKUP --compare cell.yaml"},
    {"export-robot",
     "  trammel export-robot cell.model -o robot.urdf\n"
     "  trammel export-robot cell.model -o robot.yaml --table robot.csv"},
    {"confirm-robot", "  trammel confirm-robot cell.yaml --poses shown.csv"},
    {"submit", "  trammel submit cell-7 batch.csv --watch"},
    {"retrain", "  trammel retrain cell-7 --batch b1 --batch b2 --watch"},
    {"status",
     "  trammel status\n  trammel status -o wide\n  trammel status --port 17500 --json -"},
    {"watch", "  trammel watch 12"},
    {"cancel", "  trammel cancel 12"},
    {"models", "  trammel models cell-7"},
    {"show", "  trammel show cell-7@3"},
    {"jobs", "  trammel jobs cell-7"},
    {"batches",
     "  trammel batches cell-7\n"
     "  trammel batches cell-7 b1 -o b1.csv"},
    {"activate", "  trammel activate cell-7@3 --reason \"checked on 12 poses\""},
    {"rollback", "  trammel rollback cell-7 --expected 3 --reason \"drill jig was loose\""},
    {"release", "  trammel release cell-7 b2"},
    {"discard", "  trammel discard cell-7 b2"},
    {"export", "  trammel export cell-7 -o cell-7.model"},
    {"import", "  trammel import cell-7 cell-7.model"},
    {"audit", "  trammel audit cell-7"},
    {"history", "  trammel history cell-7 -o history.html"},
    {"replay",
     "  trammel replay cell-7.model /var/lib/trammel/records\n"
     "  trammel replay cell-7@4 requests-000000001.jsonl --strict\n"
     "  trammel replay cell-7@5 --next-poses next.csv"},
    {"backup",
     "  trammel backup --store data/trammel.db -o monday.db\n"
     "  trammel backup --check monday.db"},
    {"store",
     "  trammel store init postgresql://owner@db-1/trammel --grant trammel\n"
     "  trammel store copy data/trammel.db postgresql://owner@db-1/trammel\n"
     "  trammel store copy --keep-source postgresql://owner@db-1/trammel monday.db\n"
     "  trammel store reopen data/trammel.db\n"
     "  trammel store check data/trammel.db\n"
     "  trammel store describe postgresql://db-1/trammel --cell cell-7 --as line-2"},
    {"help",
     "  trammel help start\n  trammel help all\n  trammel help formats\n  trammel help train"},
    {"doctor", "  trammel doctor\n  trammel doctor --port 17501 --store data/trammel.db --json -"},
    {"completion",
     "  source <(trammel completion bash)\n"
     "  trammel completion zsh > _trammel"},
    {"manual", "  trammel manual -o man1"},
};

}  // namespace

std::string_view overview() {
  return "Makes an industrial robot land where it was told to.\n"
         "\n"
         "new here?                trammel help start\n"
         "\n"
         "from measurements to a model\n"
         "  plan CELL              choose poses to measure\n"
         "  train CELL BATCH       calibrate the robot, learn what is left over\n"
         "  evaluate MODEL BATCH   errors on poses that were held out\n"
         "  report MODEL           a page that people look at\n"
         "\n"
         "use it\n"
         "  correct MODEL PROGRAM  a robot program, or targets, that land where wanted\n"
         "\n"
         "keep it true\n"
         "  check MODEL BATCH      is the robot still as the model has it?\n"
         "  diagnose CELL BATCH    which physical cause does the model lack?\n"
         "\n"
         "with a running service\n"
         "  submit CELL BATCH      hand measurements in; a model is trained from them\n"
         "  status                 servers, models in force, jobs\n"
         "  activate CELL@VERSION  put a version in force\n"
         "\n"
         "MODEL is a file, or CELL@VERSION of a service.\n"
         "trammel COMMAND --help tells a command's options.\n"
         "trammel help all lists all commands and topics.\n";
}

std::span<const HelpTopic> help_topics() { return kTopics; }

std::string_view examples_of(std::string_view command) {
  const auto at = std::find_if(std::begin(kExamples), std::end(kExamples),
                               [&](const auto& entry) { return entry.first == command; });
  return at == std::end(kExamples) ? std::string_view() : at->second;
}

std::string_view common_footer() {
  return "Joints are in deg (rails in mm), positions in mm, standard deviations in the unit of "
         "what they belong to.\n"
         "An output file named '-' is standard output. Errors go to standard error and name file, "
         "row, value and limit.\n"
         "Exit codes: 0 done; 1 done but not all (targets left as they were, a new model not in "
         "force); 2 wrong usage; 3 refused data; 4 service unreachable or busy.\n"
         "trammel help all lists commands and topics: formats, cell, units, service, ...";
}

}  // namespace trammel::cli
