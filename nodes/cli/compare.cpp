// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/compare.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/text.hpp"

namespace dynid {
namespace {

struct CompareArguments {
  Output output;
  std::vector<std::string> diagnoses;
  std::string report;
};

std::string command_line(const CompareArguments& a) {
  std::string line = "dynid compare";
  for (const std::string& path : a.diagnoses) line += " " + shell_quoted(path);
  if (!a.report.empty()) line += " --report " + shell_quoted(a.report);
  return line;
}

void run_compare(const CompareArguments& a) {
  a.output.check({a.report});
  CompareJob job;
  for (const std::string& path : a.diagnoses) job.diagnoses.push_back({path, read_file(path)});
  const CompareReport report = run(job);
  if (!a.report.empty()) write_file(a.report, report.html(command_line(a), DYNID_VERSION));
  a.output.write(to_json(report));
  if (!a.output.summary()) return;
  print(std::cout, report);
  if (!a.report.empty()) std::cout << "Report: " << a.report << "\n";
}

}  // namespace

void add_compare(CLI::App& app, int& status) {
  auto a = std::make_shared<CompareArguments>();
  CLI::App* command = app.add_subcommand("compare", "Two or more diagnoses side by side: what changed");
  command->add_option("diagnoses", a->diagnoses, "What dynid diagnose --json wrote, two or more files")
      ->required()
      ->expected(-2)
      ->type_name("A.json B.json...");
  command->add_option("--report", a->report, "Page to write (HTML, self-contained)")->type_name("FILE");
  a->output.add_to(*command);
  command->footer("Example: dynid compare monday.json tuesday.json --report compare.html");
  command->callback([a, &status] {
    run_compare(*a);
    status = 0;
  });
}

}  // namespace dynid
