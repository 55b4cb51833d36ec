//! Published cases. The data is not part of the repository: without it the tests fail, unless
//! `IMPINGE_NO_DATA=1` is set.

use impinge_exact::triangles_intersect;
use impinge_testing::published::{self as files, Published};

fn check(case: &Published) {
    let Published {
        triangles: [a, b],
        intersect,
        name,
    } = case;
    assert_eq!(triangles_intersect(a, b), *intersect, "{name}");
    assert_eq!(triangles_intersect(b, a), *intersect, "{name}, swapped");
}

#[test]
fn random_pairs_of_shen_heng_and_tang() {
    for case in files::random_pairs().unwrap_or_default() {
        check(&case);
    }
}

#[test]
fn special_pairs_of_other_projects() {
    for case in files::special_pairs().unwrap_or_default() {
        check(&case);
        let [a, b] = &case.triangles;
        assert_eq!(
            crate::oracle::intersect(a, b),
            case.intersect,
            "oracle: {}",
            case.name
        );
    }
}
