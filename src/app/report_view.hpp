// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "dynid/app/report.hpp"
#include "page_plots.hpp"

namespace dynid::detail {

// What the sections of the page show (src/app/page/), of `json`, a diagnosis as to_json() has it.

/// All of them, and the plots of the page, whose data are not in it yet: see add_plot_data().
nlohmann::json report_view(const Diagnosis& diagnosis, const ReportContext& context,
                           std::vector<PlotGroup>& plots);

/// The effects, their parameters and aliases: `effects`, `alias_note`, `nominal_error`.
void add_effects_view(const nlohmann::json& json, nlohmann::json& view);
/// The table of joints and regimes, and the windows: `joints`, `columns`, `groups`, `windows`, `any_window`.
void add_where_view(const nlohmann::json& json, nlohmann::json& view);

/// The first panel, whether the log can answer: what was recorded, how the joints move, how the logs are
/// read, what could not be seen on them.
nlohmann::json answerable_view(const nlohmann::json& json);

/// The file's name without its folder.
std::string file_name(const std::string& path);

}  // namespace dynid::detail
