//! Many short lists in two arrays.

/// List `i` is `entries[starts[i]..starts[i + 1]]`.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lists {
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Lists {
    /// For each vertex, its places among the corners of the tuples: N · tuple + corner, ascending.
    pub fn of_corners<const N: usize>(
        n_vertices: usize,
        tuples: impl Iterator<Item = [u32; N]> + Clone,
    ) -> Self {
        let mut lists = Lists::default();
        lists.rebuild(n_vertices, tuples);
        lists
    }

    /// Like [`of_corners`](Lists::of_corners), but reuses memory: counts, prefix sum, scatter.
    pub fn rebuild<const N: usize>(
        &mut self,
        n_vertices: usize,
        tuples: impl Iterator<Item = [u32; N]> + Clone,
    ) {
        self.starts.clear();
        self.starts.resize(n_vertices + 2, 0);
        let mut n_entries = 0;
        for tuple in tuples.clone() {
            tuple.iter().for_each(|&v| self.starts[v as usize + 2] += 1);
            n_entries += N;
        }
        for k in 2..self.starts.len() {
            self.starts[k] += self.starts[k - 1];
        }
        self.entries.clear();
        self.entries.resize(n_entries, 0);
        // At first starts[v + 1] is the beginning of list v. Filling the list advances it to the
        // end of the list, which is the beginning of list v + 1, as it should be.
        let mut entry = 0;
        for tuple in tuples {
            for vertex in tuple {
                let next = &mut self.starts[vertex as usize + 1];
                self.entries[*next as usize] = entry;
                *next += 1;
                entry += 1;
            }
        }
        self.starts.pop();
    }

    /// Appends a list.
    pub fn push(&mut self, list: impl IntoIterator<Item = u32>) {
        if self.starts.is_empty() {
            self.starts.push(0);
        }
        self.entries.extend(list);
        self.starts.push(self.entries.len() as u32);
    }

    /// The same lists with every entry mapped.
    pub fn map(mut self, map: impl Fn(u32) -> u32) -> Self {
        self.entries
            .iter_mut()
            .for_each(|entry| *entry = map(*entry));
        self
    }

    #[inline]
    pub fn get(&self, list: usize) -> &[u32] {
        &self.entries[self.range(list)]
    }

    /// The range of the list in the entries.
    #[inline]
    pub fn range(&self, list: usize) -> std::ops::Range<usize> {
        self.starts[list] as usize..self.starts[list + 1] as usize
    }

    pub fn entries(&self) -> &[u32] {
        &self.entries
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_found_again() {
        let mut lists = Lists::of_corners(5, [[0, 2], [2, 4], [4, 0], [2, 0]].into_iter());
        let all = |lists: &Lists, n| (0..n).map(|v| lists.get(v).to_vec()).collect::<Vec<_>>();
        let expected: [&[u32]; 5] = [&[0, 5, 7], &[], &[1, 2, 6], &[], &[3, 4]];
        assert_eq!(all(&lists, 5), expected);
        lists.rebuild(2, [[1]].into_iter());
        let expected: [&[u32]; 2] = [&[], &[0]];
        assert_eq!(all(&lists, 2), expected);
    }
}
