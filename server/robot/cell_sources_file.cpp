#include "server/robot/cell_sources_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "server/base/yaml_file.h"

namespace trammel {

namespace {

/// Begin and end of a value in the text.
struct Span {
  std::size_t begin = 0, end = 0;
};

std::string list_of(const std::vector<std::string>& sources) {
  return fmt::format("[{}]", fmt::join(sources, ", "));
}

std::size_t line_start(const std::string& text, std::size_t at) {
  const std::size_t newline = at == 0 ? std::string::npos : text.rfind('\n', at - 1);
  return newline == std::string::npos ? 0 : newline + 1;
}

/// The start of the line after the one that holds `at`.
std::size_t next_line(const std::string& text, std::size_t at) {
  const std::size_t newline = text.find('\n', at);
  return newline == std::string::npos ? text.size() : newline + 1;
}

/// The span of a flow list, from `[` to `]`. A list of words contains no other list.
Span flow_list(const std::string& text, std::size_t open) {
  bool comment = false;
  for (std::size_t at = open; at < text.size(); ++at) {
    if (text[at] == '\n') comment = false;
    if (text[at] == '#' && (text[at - 1] == ' ' || text[at - 1] == '\n')) comment = true;
    if (text[at] == ']' && !comment) return {open, at + 1};
  }
  return {open, text.size()};
}

/// The span of a block list. Its lines begin with a dash in the column of the first dash.
Span block_list(const std::string& text, std::size_t first_dash) {
  const std::size_t indent = first_dash - line_start(text, first_dash);
  std::size_t end = first_dash;
  for (std::size_t at = line_start(text, first_dash); at < text.size(); at = next_line(text, at)) {
    const std::size_t word = text.find_first_not_of(' ', at);
    if (word == std::string::npos) break;
    const bool item = word - at == indent && text[word] == '-';
    const bool nothing = text[word] == '\n' || text[word] == '#' || text[word] == '\r';
    if (item) end = std::min(text.size(), text.find_first_of("\r\n", word));
    if (!item && !nothing) break;
  }
  return {first_dash, std::min(end, text.size())};
}

/// The text with the present list replaced, in the same style (flow or block).
std::string replaced(const std::string& text, std::size_t mark,
                     const std::vector<std::string>& sources) {
  const bool flow = text[mark] == '[';
  const Span span = flow ? flow_list(text, mark) : block_list(text, mark);
  const std::string indent(mark - line_start(text, mark), ' ');
  const std::string list =
      flow ? list_of(sources) : fmt::format("- {}", fmt::join(sources, "\n" + indent + "- "));
  return text.substr(0, span.begin) + list + text.substr(span.end);
}

/// The text with the list inserted before the first key of the mapping `model`.
std::string inserted(const std::string& text, const YAML::Node& model, const std::string& list) {
  const std::string entry = "error_sources: " + list;
  const auto mark = static_cast<std::size_t>(model.Mark().pos);
  if (text[mark] == '{') {
    const std::size_t next = text.find_first_not_of(' ', mark + 1);
    const bool empty = next != std::string::npos && text[next] == '}';
    return text.substr(0, mark + 1) + entry + (empty ? "" : ", ") +
           text.substr(empty ? next : mark + 1);
  }
  const std::size_t indent = mark - line_start(text, mark);
  return text.substr(0, mark) + entry + "\n" + std::string(indent, ' ') + text.substr(mark);
}

std::string edited(const std::string& text, const YAML::Node& root,
                   const std::vector<std::string>& sources) {
  const std::string list = list_of(sources);
  const YAML::Node model = root["model"];
  if (!model.IsDefined() || !model.IsMap()) {
    const bool ended = text.empty() || text.back() == '\n';
    return text + (ended ? "" : "\n") + "model: {error_sources: " + list + "}\n";
  }
  const YAML::Node present = model["error_sources"];
  if (present.IsDefined() && present.IsSequence())
    return replaced(text, static_cast<std::size_t>(present.Mark().pos), sources);
  return inserted(text, model, list);
}

/// The content of the file without the list, for comparison.
std::string all_but_the_list(const std::string& text) {
  YAML::Node root = YAML::Load(text);
  if (root["model"].IsDefined() && root["model"].IsMap()) root["model"].remove("error_sources");
  if (root["model"].IsDefined() && root["model"].size() == 0) root.remove("model");
  return YAML::Dump(root);
}

}  // namespace

Result<std::string> with_error_sources(const std::string& cell_yaml,
                                       const std::vector<std::string>& sources,
                                       const std::string& where) {
  std::string why = "the list stands elsewhere";
  try {
    TRY(check_yaml_limits(cell_yaml, where));
    const std::string text = edited(cell_yaml, YAML::Load(cell_yaml), sources);
    const auto read = YAML::Load(text)["model"]["error_sources"].as<std::vector<std::string>>();
    if (read == sources && all_but_the_list(text) == all_but_the_list(cell_yaml)) return text;
  } catch (const YAML::Exception& error) {
    why = error.what();
  }
  return refused("cannot be changed in place ({})", why)
      .under("model: error_sources")
      .in(where)
      .next("write it as [base, geometry, ...]");
}

}  // namespace trammel
