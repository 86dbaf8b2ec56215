//! The report as one page that needs nothing else.

use std::fmt::Write;

use plotters::style::RGBColor;

use super::Report;
use super::evidence::Evidence;
use super::figures::{drawn, shown, signed, significant, valued};
use super::schema::{Errors, Measured, Parameter, Status, Verdict};
use super::svg;
use super::text::{RIVALS, against, entry, grouped, held_back, in_doubt, probability, told, worse};

/// Candidates listed for each effect.
const CANDIDATES: usize = 8;

const STYLE: &str = "
body{font:15px/1.45 system-ui,sans-serif;color:#222;max-width:940px;margin:2em auto;padding:0 1em}
h1{font-size:1.5em;margin-bottom:.2em}h2{font-size:1.1em;margin:1.8em 0 .4em}
.verdict{padding:.6em .9em;border-left:5px solid;background:#f6f6f4;margin:1em 0}
.good{border-color:#2e8b57}.open{border-color:#c47a1c}
table{border-collapse:collapse}td,th{padding:.18em .7em;text-align:right;border-bottom:1px solid #e4e4e0}
td:first-child,th:first-child{text-align:left}th{font-weight:600}
.verdict p{margin:.4em 0}.verdict ul{margin:.3em 0;padding-left:1.2em;font-size:.85em;color:#555}
.steps td{white-space:nowrap}.steps td:first-child,.steps td.why{white-space:normal}
.steps tr:not(.not) td{border-bottom:0}.plots+table{margin-top:.6em}
.not td{color:#777}td.why{text-align:left;font-size:.9em}
.plots{display:flex;flex-wrap:wrap;gap:.4em}.key span{margin-right:1.2em}
.key i{display:inline-block;width:.8em;height:.8em;margin-right:.35em}
svg{max-width:100%;height:auto}small{color:#666}li{margin:.15em 0}
";

/// The page.
pub fn html(report: &Report) -> Result<String, Box<dyn std::error::Error>> {
    let s = &report.summary;
    let mut out = String::new();
    let title = escaped(&s.robot);
    write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <title>{title}: calibration</title><style>{STYLE}</style></head><body>\n\
         <h1>{title}</h1>\n"
    )?;
    let what = s.measured.words();
    writeln!(
        out,
        "<p>Identified from {} rows of {what}, checked on {} that no fit has seen.</p>",
        s.rows.identify, s.rows.verify
    )?;
    let class = match s.verdict {
        Verdict::Explained | Verdict::NothingMissing => "good",
        Verdict::StructureRemains | Verdict::Ambiguous => "open",
    };
    writeln!(
        out,
        "<div class=\"verdict {class}\"><b>{}</b><p>{}</p><ul>",
        capital(s.verdict.words()),
        escaped(&plainly(report))
    )?;
    for reason in &report.reasons {
        writeln!(out, "<li>{}</li>", capital(&escaped(reason)))?;
    }
    writeln!(out, "</ul></div>")?;

    writeln!(out, "<h2>Error of the held-back rows</h2>")?;
    let effects = !s.effects.is_empty();
    errors(&mut out, &s.error_mm, "mm", effects)?;
    if let Some(e) = &s.error_deg {
        errors(&mut out, e, "deg", effects)?;
    }
    noise(&mut out, report)?;
    key(&mut out, &svg::models(effects))?;
    writeln!(
        out,
        "<div class=\"plots\">{}{}</div>",
        svg::bars(report)?,
        svg::histogram(report)?
    )?;

    if effects {
        writeln!(out, "<h2>Effects</h2>")?;
        steps(&mut out, &report.evidence)?;
        effect_table(&mut out, report)?;
    }
    for evidence in &report.evidence {
        gave_away(&mut out, evidence)?;
    }
    residual(&mut out, report)?;
    writeln!(out, "<h2>Parameters</h2>")?;
    parameters(&mut out, &s.parameters)?;
    for (title, sentences) in [
        ("Assumed", &report.assumed),
        ("Held back", &report.held_back),
        ("Noticed", &report.noticed),
    ] {
        if !sentences.is_empty() {
            writeln!(out, "<h2>{title}</h2><ul>")?;
            for sentence in sentences {
                writeln!(out, "<li>{}</li>", escaped(sentence))?;
            }
            writeln!(out, "</ul>")?;
        }
    }
    writeln!(out, "</body></html>")?;
    Ok(out)
}

/// What was found and what it is worth, in one sentence.
fn plainly(report: &Report) -> String {
    let e = &report.summary.error_mm;
    let [nominal, before, after] = [e.nominal.rms, e.geometric.rms, e.complete.spread.rms];
    let [nominal, before, after] = [nominal, before, after].map(significant);
    let Some(first) = report.evidence.first() else {
        return format!(
            "Identifying the geometry takes the typical error from {nominal} mm to {before} mm."
        );
    };
    let most = match report.evidence.len() - 1 {
        0 => String::new(),
        1 => " and one more effect".to_owned(),
        more => format!(" and {more} more effects"),
    };
    format!(
        "{}: with that{most} in the model the error falls from {before} mm to {after} mm on rows \
         that no fit has seen.",
        capital(&first.words)
    )
}

fn errors(out: &mut String, e: &Errors, unit: &str, effects: bool) -> std::fmt::Result {
    let [low, high] = e.complete.rms_interval95;
    let interval = format!("{} to {}", significant(low), significant(high));
    let mut rows = vec![("as drawn, base and tool aligned", e.nominal, String::new())];
    if effects {
        rows.push(("geometry identified", e.geometric, String::new()));
        rows.push(("geometry and effects", e.complete.spread, interval));
    } else {
        rows.push(("geometry identified", e.geometric, interval));
    }
    writeln!(
        out,
        "<table><tr><th>{unit}</th><th>rms</th><th>95 % interval</th><th>mean</th>\
         <th>largest</th></tr>"
    )?;
    for (name, spread, interval) in rows {
        writeln!(
            out,
            "<tr><td>{name}</td><td>{}</td><td>{interval}</td><td>{}</td><td>{}</td></tr>",
            significant(spread.rms),
            significant(spread.mean),
            significant(spread.max)
        )?;
    }
    writeln!(out, "</table><br>")
}

fn noise(out: &mut String, report: &Report) -> std::fmt::Result {
    let s = &report.summary;
    let mut each = vec![(s.noise_mm, "mm")];
    each.extend(s.noise_deg.map(|n| (n, "deg")));
    for (noise, unit) in each {
        let declared = match noise.declared {
            Some(x) => format!("{} {unit} declared", significant(x)),
            None => "not declared".to_owned(),
        };
        writeln!(
            out,
            "<p>Noise an axis: {declared}, {}.</p>",
            noise.left_by_fit(unit)
        )?;
    }
    Ok(())
}

fn key(out: &mut String, entries: &[(&str, RGBColor)]) -> std::fmt::Result {
    write!(out, "<p class=\"key\">")?;
    for (name, RGBColor(r, g, b)) in entries {
        write!(
            out,
            "<span><i style=\"background:rgb({r},{g},{b})\"></i>{name}</span>"
        )?;
    }
    writeln!(out, "</p>")
}

fn effect_table(out: &mut String, report: &Report) -> std::fmt::Result {
    let s = &report.summary;
    writeln!(
        out,
        "<table><tr><th>effect</th><th>parameter</th><th>value</th><th>&plusmn;</th>\
         <th>unit</th></tr>"
    )?;
    for e in &s.effects {
        let name = entry(e);
        for (parameter, value) in told(e) {
            let (unit, factor) = shown(e.unit(parameter));
            let sigma = e.sigma.get(parameter);
            writeln!(
                out,
                "<tr><td>{}</td><td>{parameter}</td><td>{}</td><td>{}</td><td>{unit}</td></tr>",
                escaped(&name),
                significant(value * factor),
                sigma.map_or_else(|| "-".to_owned(), |s| significant(s * factor))
            )?;
        }
    }
    writeln!(out, "</table>")
}

/// What was found, what explains most first, what it did for rows that its fits had not seen, its rivals.
fn steps(out: &mut String, evidence: &[Evidence]) -> std::fmt::Result {
    if evidence.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "<table class=\"steps\"><tr><th rowspan=\"2\">found, what explains<br>most first</th>\
         <th rowspan=\"2\">rms without<br>and with it, mm</th>\
         <th colspan=\"3\">left of the error of rows left out,<br>when it was found, %</th>\
         <th rowspan=\"2\">chance</th></tr>\
         <tr><th>random</th><th>by time</th><th>by joints</th></tr>"
    )?;
    for e in evidence {
        let [random, time, space] = held_back(e);
        writeln!(
            out,
            "<tr><td>{}<br><small>{}</small></td><td>{} to {}</td><td>{random}</td>\
             <td>{time}</td><td>{space}</td><td>{}</td></tr>",
            escaped(&e.label),
            escaped(&e.words),
            significant(e.rms_mm[0]),
            significant(e.rms_mm[1]),
            probability(e.ln_p.exp().min(1.0))
        )?;
        let rivals = e.rivals.iter().take(RIVALS).map(|r| {
            let similar = significant(r.similarity);
            format!(
                "{} (similarity {similar}, {})",
                r.name(),
                worse(r.delta_bic)
            )
        });
        let rivals: Vec<String> = rivals.collect();
        let others = (!rivals.is_empty()).then(|| format!("or: {}", rivals.join("; ")));
        let said = [
            e.doubt.as_deref().map(in_doubt),
            e.control.map(|c| against(&c)),
            others,
        ];
        let said: Vec<String> = said.into_iter().flatten().map(|s| escaped(&s)).collect();
        writeln!(
            out,
            "<tr class=\"not\"><td colspan=\"6\" class=\"why\">{}</td></tr>",
            said.join("<br>")
        )?;
    }
    writeln!(out, "</table><br>")
}

/// Why this effect and no other: its covariate, its periodogram, its competitors.
fn gave_away(out: &mut String, evidence: &Evidence) -> Result<(), Box<dyn std::error::Error>> {
    let label = escaped(&evidence.label);
    writeln!(out, "<h2>What gave it away: {label}</h2>")?;
    if !evidence.panels.is_empty() {
        writeln!(
            out,
            "<p>Held-back rows, each a point. Without the effect the residual follows what the \
             effect depends on; with it, it should not.</p>"
        )?;
        key(out, &svg::before_and_after())?;
    }
    writeln!(out, "<div class=\"plots\">")?;
    for panel in &evidence.panels {
        writeln!(out, "{}", svg::against_covariate(panel)?)?;
    }
    if !evidence.periodogram.is_empty() {
        writeln!(
            out,
            "{}",
            svg::periodogram(&evidence.periodogram, "the joint")?
        )?;
    }
    writeln!(out, "</div>")?;
    if !evidence.ranking.is_empty() {
        writeln!(
            out,
            "<table><tr><th>the best candidates then</th><th>of the squared residual</th>\
             <th>p, all candidates considered</th></tr>"
        )?;
        for r in evidence.ranking.iter().take(CANDIDATES) {
            writeln!(
                out,
                "<tr><td>{}</td><td>{} %</td><td>{}</td></tr>",
                escaped(&r.label),
                significant(100.0 * r.share),
                probability(r.ln_p.exp().min(1.0))
            )?;
        }
        writeln!(out, "</table>")?;
    }
    Ok(())
}

fn residual(out: &mut String, report: &Report) -> Result<(), Box<dyn std::error::Error>> {
    writeln!(out, "<h2>What is left, against the joints</h2>")?;
    if report.summary.measured == Measured::Length {
        writeln!(out, "<p>Measured minus predicted length.</p>")?;
    } else {
        writeln!(
            out,
            "<p>Measured minus predicted position of the held-back rows, axes of the robot \
             base. A band that waves or leans is what the model lacks.</p>"
        )?;
        let [x, y, z] = svg::AXES;
        key(out, &[("x", x), ("y", y), ("z", z)])?;
    }
    writeln!(out, "<div class=\"plots\">")?;
    for joint in 0..report.joint_units.len() {
        writeln!(out, "{}", svg::against_joint(report, joint)?)?;
    }
    writeln!(out, "</div>")?;
    Ok(())
}

fn parameters(out: &mut String, parameters: &[Parameter]) -> std::fmt::Result {
    writeln!(
        out,
        "<table><tr><th>parameter</th><th>value</th><th>&plusmn;</th><th>unit</th>\
         <th>drawn</th><th>change</th></tr>"
    )?;
    for p in parameters.iter().filter(|p| p.status == Status::Identified) {
        let (unit, factor) = shown(&p.unit);
        let sigma = p
            .sigma
            .map_or_else(|| "-".to_owned(), |s| significant(s * factor));
        writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{sigma}</td><td>{unit}</td><td>{}</td><td>{}</td></tr>",
            escaped(&p.name),
            valued(p.value * factor, p.sigma.map(|s| s * factor)),
            drawn(p.nominal * factor),
            signed((p.value - p.nominal) * factor)
        )?;
    }
    writeln!(
        out,
        "</table><p><small>Base and tool: drawn is what aligns the drawn geometry.</small></p>"
    )?;
    let groups = grouped(parameters);
    if groups.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "<h2>Not identified, kept as drawn, and why</h2><table>"
    )?;
    for (names, status, note) in groups {
        let word = match status {
            Status::Merged => "merged",
            _ => "fixed",
        };
        writeln!(
            out,
            "<tr class=\"not\"><td>{}</td><td>{word}</td><td class=\"why\">{}</td></tr>",
            escaped(&names.join(", ")),
            escaped(note)
        )?;
    }
    writeln!(out, "</table>")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
