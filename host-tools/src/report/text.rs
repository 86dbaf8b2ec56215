//! The report on the terminal.

use std::fmt::Write;

use super::Report;
use super::evidence::Evidence;
use super::figures::{drawn, shown, signed, significant, valued};
use super::schema::{Effect, Errors, Measured, Noise, Parameter, Status, Verdict};
use crate::diagnose::control::Control;

/// Rivals listed for each effect.
pub(super) const RIVALS: usize = 4;

impl Verdict {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Explained => "explained: with the effects, what is left is noise",
            Self::NothingMissing => "nothing missing: geometry alone leaves nothing but noise",
            Self::StructureRemains => "structure remains: more is there than the model says",
            Self::Ambiguous => "ambiguous: these poses cannot tell the effects found apart",
        }
    }
}

impl Measured {
    /// In words.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Position => "positions",
            Self::Pose => "full poses",
            Self::Length => "lengths",
            Self::Bearing => "bearings",
            Self::Distance => "distances between poses",
            Self::Point => "touches of fixed points",
            Self::Plane => "touches of fixed planes",
            Self::Board => "poses of a fixed board, seen from the tool",
            Self::Mark => "fixed points, seen from the tool",
            Self::Sight => "bearings of fixed points, seen from the tool",
        }
    }
}

/// The report as text, with its last line break.
pub fn text(report: &Report) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write(report, &mut out);
    out
}

fn write(report: &Report, out: &mut String) -> std::fmt::Result {
    let s = &report.summary;
    let what = s.measured.words();
    writeln!(
        out,
        "{}: identified from {} rows of {what}, checked on {} that no fit has seen",
        s.robot, s.rows.identify, s.rows.verify
    )?;
    let e = &s.estimator;
    writeln!(
        out,
        "estimator {}, {} loss, {} passes",
        e.name, e.loss, e.iterations
    )?;
    writeln!(out)?;
    let named = !s.effects.is_empty();
    errors(out, &s.error_mm, "mm", named)?;
    if let Some(e) = &s.error_deg {
        errors(out, e, "deg", named)?;
    }
    if let Some(b) = &s.error_mm_blocks {
        writeln!(
            out,
            "on blocks left out in turn, rms: geometry {} mm, final {} mm",
            significant(b.geometric.rms),
            significant(b.complete.rms)
        )?;
    }
    if let Some(m) = &s.model_sigma_mm {
        writeln!(
            out,
            "tool point by the parameters' covariance, 1 sigma at those rows: {} mm rms, {} mm at \
             most",
            significant(m.rms),
            significant(m.max)
        )?;
    }
    noise(out, &s.noise_mm, "mm")?;
    if let Some(n) = &s.noise_deg {
        noise(out, n, "deg")?;
    }
    writeln!(out)?;
    writeln!(out, "verdict  {}", s.verdict.words())?;
    for reason in &report.reasons {
        writeln!(out, "  {reason}")?;
    }
    steps(out, &report.evidence)?;
    if named {
        writeln!(out)?;
        writeln!(out, "effects")?;
        for e in &s.effects {
            effect(out, e)?;
        }
    }
    parameters(out, &s.parameters)?;
    omissions(out, &s.parameters)?;
    for (title, sentences) in [
        ("assumed", &report.assumed),
        ("held back", &report.held_back),
        ("noticed", &report.noticed),
    ] {
        if !sentences.is_empty() {
            writeln!(out)?;
            writeln!(out, "{title}")?;
            for sentence in sentences {
                writeln!(out, "  {sentence}")?;
            }
        }
    }
    Ok(())
}

fn errors(out: &mut String, e: &Errors, unit: &str, effects: bool) -> std::fmt::Result {
    writeln!(
        out,
        "{:<40}{:>10}{:>10}{:>10}",
        format!("error of the held-back rows, {unit}"),
        "rms",
        "mean",
        "max"
    )?;
    let mut rows = vec![
        ("as drawn, base and tool aligned", e.nominal),
        ("geometry identified", e.geometric),
    ];
    if effects {
        rows.push(("geometry and effects", e.complete.spread));
    }
    for (name, spread) in rows {
        writeln!(
            out,
            "  {name:<38}{:>10}{:>10}{:>10}",
            significant(spread.rms),
            significant(spread.mean),
            significant(spread.max)
        )?;
    }
    let [low, high] = e.complete.rms_interval95;
    writeln!(
        out,
        "  the last rms lies between {} and {} {unit} (95 %)",
        significant(low),
        significant(high)
    )
}

impl Noise {
    /// What the fit leaves, in words.
    pub(super) fn left_by_fit(&self, unit: &str) -> String {
        match self.estimated {
            Some(x) => format!("{} {unit} left by the fit", significant(x)),
            None => "no more equations than parameters to tell it from".to_owned(),
        }
    }
}

fn noise(out: &mut String, noise: &Noise, unit: &str) -> std::fmt::Result {
    let declared = match noise.declared {
        Some(x) => format!("{} {unit} declared", significant(x)),
        None => "not declared".to_owned(),
    };
    let estimated = noise.left_by_fit(unit);
    writeln!(out, "noise an axis: {declared}, {estimated}")
}

fn effect(out: &mut String, e: &Effect) -> std::fmt::Result {
    let mut values = Vec::new();
    for (parameter, value) in told(e) {
        let (unit, factor) = shown(e.unit(parameter));
        let error = e.sigma.get(parameter).map_or_else(String::new, |sigma| {
            format!(" +- {}", significant(sigma * factor))
        });
        let value = significant(value * factor);
        values.push(
            format!("{parameter} {value}{error} {unit}")
                .trim_end()
                .to_owned(),
        );
    }
    writeln!(out, "  {}: {}", entry(e), values.join(", "))
}

/// Name of an effect; of a term without a name where it acts and by what.
pub(super) fn entry(e: &Effect) -> String {
    if e.depends_on.is_empty() {
        return e.name();
    }
    let place = match (e.joint, &e.component) {
        (Some(joint), _) => format!("joint {joint}"),
        (None, Some(axis)) => format!("base {axis}"),
        (None, None) => "base".to_owned(),
    };
    format!("{place} unnamed, by {}", e.depends_on.join(" and "))
}

/// Values that say something by themselves: of a term without a name the label says the rest.
pub(super) fn told(e: &Effect) -> impl Iterator<Item = (&str, f64)> {
    let nameless = e.kind == "unnamed";
    let all = e
        .parameters
        .iter()
        .map(|(name, value)| (name.as_str(), *value));
    all.filter(move |(name, _)| !nameless || *name == "amplitude")
}

/// What was found, one a line, what explains most first.
fn steps(out: &mut String, evidence: &[Evidence]) -> std::fmt::Result {
    if evidence.is_empty() {
        return Ok(());
    }
    writeln!(out)?;
    writeln!(
        out,
        "found, what explains most first; rms of the held-back rows with it and those above, mm; \
         when it\nwas found, error that remained of rows left out of its fits at random, in blocks \
         of time, of joint\nspace, %; probability by chance"
    )?;
    for e in evidence {
        let held_back = held_back(e);
        writeln!(
            out,
            "  {:<40}{:>8}   {:>5}{:>6}{:>6}   {}",
            e.label,
            significant(e.rms_mm[1]),
            held_back[0],
            held_back[1],
            held_back[2],
            probability(e.ln_p.exp().min(1.0))
        )?;
        let said = [
            e.doubt.as_deref().map(in_doubt),
            e.control.map(|c| against(&c)),
        ];
        for sentence in said.into_iter().flatten() {
            writeln!(out, "    {sentence}")?;
        }
        for r in e.rivals.iter().take(RIVALS) {
            writeln!(
                out,
                "    or {}: similarity {}, {}",
                r.name(),
                significant(r.similarity),
                worse(r.delta_bic)
            )?;
        }
    }
    Ok(())
}

/// The three held-back ratios in percent; dashes for what came in by exchange.
pub(super) fn held_back(e: &Evidence) -> [String; 3] {
    e.held_back.map_or_else(
        || ["-", "-", "-"].map(str::to_owned),
        |held_back| held_back.map(|r| significant(100.0 * r)),
    )
}

/// Why a name is in doubt.
pub(super) fn in_doubt(why: &str) -> String {
    format!("in doubt, it only looks like this: {why}")
}

/// An effect's control in words.
pub(super) fn against(c: &Control) -> String {
    let percent = |share: f64| significant(100.0 * share);
    let before = c.move_before.map_or_else(String::new, |share| {
        format!(", by the move before the last {} %", percent(share))
    });
    format!(
        "takes {} % of what is left beside it; with the {} shuffled {} %, at most {} %{before}",
        percent(c.own),
        c.covariate,
        percent(c.shuffled),
        percent(c.largest)
    )
}

/// A difference in BIC in words.
pub(super) fn worse(delta_bic: f64) -> String {
    if delta_bic < 0.0 {
        format!("BIC better by {}", significant(-delta_bic))
    } else {
        format!("BIC worse by {}", significant(delta_bic))
    }
}

/// Below 1e-16 the tail of a distribution says nothing any more.
pub(super) fn probability(p: f64) -> String {
    if p < 1e-16 {
        "below 1e-16".to_owned()
    } else {
        significant(p)
    }
}

fn parameters(out: &mut String, parameters: &[Parameter]) -> std::fmt::Result {
    let drawn_anew = parameters.iter().any(|p| p.bootstrap.is_some());
    writeln!(out)?;
    writeln!(
        out,
        "{:<44}{:>14}{:>12}{:>12}{:>12}{}",
        "parameters identified",
        "value",
        "+-",
        "drawn",
        "change",
        if drawn_anew { "   +- by draws" } else { "" }
    )?;
    for p in parameters.iter().filter(|p| p.status == Status::Identified) {
        let (unit, factor) = shown(&p.unit);
        let sigma = p
            .sigma
            .map_or_else(|| "-".to_owned(), |s| significant(s * factor));
        writeln!(
            out,
            "  {:<42}{:>14}{sigma:>12}{:>12}{:>12}{}",
            format!("{}, {unit}", p.name),
            valued(p.value * factor, p.sigma.map(|s| s * factor)),
            drawn(p.nominal * factor),
            signed((p.value - p.nominal) * factor),
            p.bootstrap.as_ref().map_or_else(String::new, |b| format!(
                "{:>14}",
                significant(b.sigma * factor)
            )),
        )?;
    }
    writeln!(
        out,
        "  (base and tool: drawn is what aligns the drawn geometry)"
    )
}

/// What was not identified, names with the same reason together.
pub(super) fn grouped(parameters: &[Parameter]) -> Vec<(Vec<&str>, Status, &str)> {
    let mut groups: Vec<(Vec<&str>, Status, &str)> = Vec::new();
    for p in parameters {
        let Some(note) = p.note.as_deref() else {
            continue;
        };
        match groups.iter_mut().find(|g| g.1 == p.status && g.2 == note) {
            Some(group) => group.0.push(&p.name),
            None => groups.push((vec![&p.name], p.status, note)),
        }
    }
    groups
}

fn omissions(out: &mut String, parameters: &[Parameter]) -> std::fmt::Result {
    let groups = grouped(parameters);
    if groups.is_empty() {
        return Ok(());
    }
    writeln!(out)?;
    writeln!(out, "not identified, kept as drawn, and why")?;
    for (names, status, note) in groups {
        let word = match status {
            Status::Merged => "merged",
            _ => "fixed",
        };
        writeln!(out, "  {} ({word}): {note}", names.join(", "))?;
    }
    Ok(())
}
