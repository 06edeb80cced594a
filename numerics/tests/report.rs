//! Reports as people and programs get them.

use hankel_numerics::report::{
    Axis, Cell, Column, Plot, Report, ReportError, Series, Style, Table, pareto_front,
};

fn sample() -> Report {
    let mut report = Report::new("Bounds & <others>", "hankel bench bounds --quick");
    report.fact("rows", 1000);
    report.notes.push("n < 6".into());
    let mut table = Table::new(
        "times",
        "Median run time",
        [
            Column::text("variant"),
            Column::count("n"),
            Column::fixed("time", 2).of("ns"),
            Column::number("error"),
            Column::percent("of peak", 1),
        ],
    );
    let row = |name: &str, time: f64, error: f64| -> [Cell; 5] {
        [
            name.into(),
            2_usize.into(),
            time.into(),
            error.into(),
            0.125.into(),
        ]
    };
    table.push(row("plain, \"f32\"", 1.5, 1.234e-7));
    table.push(row("broken", 2.0, f64::NAN));
    table.push([
        "none".into(),
        Cell::Empty,
        f64::INFINITY.into(),
        0.0.into(),
        None::<f64>.into(),
    ]);
    report.tables.push(table);
    report.plots.push(Plot {
        id: "pareto".into(),
        caption: "Run time against error".into(),
        x: Axis::logarithmic("time [ns]"),
        y: Axis::logarithmic("error"),
        series: vec![
            Series::new(
                "f32",
                Style::Dots,
                [(1.0, 1e-7), (2.0, 0.0), (3.0, f64::NAN)],
            ),
            Series::new("front", Style::Front, [(1.0, 1e-7), (2.0, 1e-9)]),
        ],
    });
    report
}

#[test]
fn a_plot_names_its_points_where_the_pointer_rests() {
    let mut series = Series::new("s", Style::Dots, [(1.0, 2.0), (3.0, 4.0)]);
    series.points[1].title = "the <second>".into();
    let plot = Plot {
        id: "p".into(),
        caption: "c".into(),
        x: Axis::linear("x"),
        y: Axis::linear("y"),
        series: vec![series],
    };
    let svg = plot.svg().unwrap();
    assert_eq!(svg.matches("<title>").count(), 1);
    // Over the second of the discs, within the picture, before its end.
    let (_, disc) = svg
        .split_once("fill-opacity=\"0\"><title>the &lt;second&gt;</title>")
        .unwrap();
    assert!(disc.trim_end().ends_with("</svg>"));
    let x = |circle: &str| {
        circle
            .split("cx=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap()
            .to_owned()
    };
    let circles: Vec<String> = svg
        .match_indices("<circle")
        .map(|(i, _)| x(&svg[i..]))
        .collect();
    assert_eq!(circles[1], *circles.last().unwrap(), "{svg}");
}

#[test]
fn text_is_for_people() {
    let text = sample().to_string();
    for part in [
        "rows: 1000",
        "| time [ns] |",
        "| 1.23e-7 |",
        "12.5 %",
        "NaN",
        "inf",
        "n < 6",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
}

#[test]
fn numbers_keep_three_digits() {
    let column = Column::number("x");
    let cases = [
        (0.0, "0"),
        (1.0, "1.00"),
        (-2.345, "-2.35"),
        (999.7, "1000"),
        (123_456.0, "123456"),
        (1_234_567.0, "1.23e6"),
        (0.001_234, "0.00123"),
        (0.000_999_7, "0.00100"),
        (1.5e-300, "1.50e-300"),
    ];
    for (x, expected) in cases {
        assert_eq!(Cell::from(x).spelled(column.form), expected);
    }
}

#[test]
fn json_comes_back() {
    let report = sample();
    let text = serde_json::to_string(&report).unwrap();
    let back: Report = serde_json::from_str(&text).unwrap();
    // What JSON cannot hold is text: compare by that.
    assert_eq!(serde_json::to_string(&back).unwrap(), text);
    assert_eq!(back.tables[0].rows[0], report.tables[0].rows[0]);
    assert!(back.plots[0].series[0].points[2].y.is_nan());
}

#[test]
fn every_file_is_written_and_parses() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new");
    let paths = sample().write(&out, "bounds", &[]).unwrap();
    let names: Vec<_> = paths
        .iter()
        .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(
        names,
        [
            "bounds.html",
            "bounds.json",
            "bounds-times.csv",
            "bounds-pareto.svg"
        ]
    );
    // Nothing else: no temporary sibling stays.
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 4);

    let html = std::fs::read_to_string(&paths[0]).unwrap();
    assert!(html.contains("<title>Bounds &amp; &lt;others&gt;</title>"));
    assert!(html.contains("<svg") && html.contains("</svg>"));
    assert!(html.contains("hankel bench bounds --quick"));
    for elsewhere in ["src=", "href=", "url(", "@import"] {
        assert!(!html.contains(elsewhere), "the page refers to {elsewhere}");
    }

    let json: Report = serde_json::from_slice(&std::fs::read(&paths[1]).unwrap()).unwrap();
    assert_eq!(json.command, "hankel bench bounds --quick");

    let mut rows = csv::Reader::from_path(&paths[2]).unwrap();
    assert_eq!(&rows.headers().unwrap()[2], "time [ns]");
    let rows: Vec<csv::StringRecord> = rows.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3);
    assert_eq!(rows[0][3].parse::<f64>().unwrap(), 1.234e-7);
    assert_eq!(&rows[0][0], "plain, \"f32\"");

    let svg = std::fs::read_to_string(&paths[3]).unwrap();
    // Two dots with finite coordinates, two rings, and the legend's.
    assert_eq!(svg.matches("<circle").count(), 6, "{svg}");
    assert!(svg.contains("time [ns]") && svg.contains("front"));
    assert!(!svg.contains("NaN"));
}

#[test]
fn plots_of_nothing_and_of_one_point_are_drawn() {
    for points in [
        vec![],
        vec![(0.0, 0.0)],
        vec![(5.0, 1e300)],
        vec![(-1.0, 1e-320)],
    ] {
        for axis in [Axis::linear("x"), Axis::logarithmic("x")] {
            let plot = Plot {
                id: "p".into(),
                caption: String::new(),
                x: axis.clone(),
                y: axis,
                series: vec![Series::new("s", Style::Dots, points.clone())],
            };
            let svg = plot.svg().unwrap();
            assert!(svg.trim_end().ends_with("</svg>"), "{svg}");
        }
    }
}

#[test]
fn a_file_stands_where_the_folder_should() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let error = sample().write(&file, "bounds", &[]).unwrap_err();
    assert!(matches!(&error, ReportError::Output(error) if !error.is_machine()));
    assert!(
        error.to_string().contains("a folder is expected"),
        "{error}"
    );
    assert_eq!(std::fs::read(&file).unwrap(), b"x");
}

#[test]
fn of_crafted_points() {
    assert!(pareto_front(&[]).is_empty());
    // A staircase with one dominated point, in no order.
    let points = [(3.0, 1.0), (1.0, 3.0), (2.0, 2.0), (2.5, 2.5)];
    assert_eq!(pareto_front(&points), [1, 2, 0]);
    // Equal in one coordinate: the better in the other.
    assert_eq!(pareto_front(&[(1.0, 2.0), (1.0, 1.0)]), [1]);
    assert_eq!(pareto_front(&[(1.0, 1.0), (2.0, 1.0)]), [0]);
    // Twins count once.
    assert_eq!(pareto_front(&[(1.0, 1.0), (1.0, 1.0)]), [0]);
}

#[test]
fn leaves_out_what_failed() {
    let points = [
        (1.0, f64::NAN),
        (f64::NAN, 0.0),
        (2.0, f64::INFINITY),
        (3.0, 0.5),
    ];
    assert_eq!(pareto_front(&points), [3]);
}

/// By the definition, on pseudo-random points.
#[test]
fn is_what_nothing_dominates() {
    let mut random = fastrand::Rng::with_seed(3);
    for _ in 0..200 {
        let points: Vec<(f64, f64)> = (0..random.usize(0..30))
            .map(|_| (f64::from(random.u8(0..12)), f64::from(random.u8(0..12))))
            .collect();
        let front = pareto_front(&points);
        for (i, p) in points.iter().enumerate() {
            let dominated = points
                .iter()
                .any(|q| q.0 <= p.0 && q.1 <= p.1 && (q.0 < p.0 || q.1 < p.1));
            let twin = points[..i].contains(p);
            assert_eq!(front.contains(&i), !dominated && !twin, "{i} of {points:?}");
        }
    }
}
