//! The roles of the simulated controller's clients.

use core::ops::RangeInclusive;
use core::str::FromStr;

use fanuc_hmi_modbus::security::Access;

/// The accesses that each role permits: `operator:read,engineer:read,engineer:write@100-199`. An item is a role, and `any`,
/// `read`, `write` or the number of a function; with `@`, only at these PDU addresses. Without items every client may do
/// everything.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Roles(Vec<Permission>);

#[derive(Debug, Clone, PartialEq, Eq)]
struct Permission {
    role: String,
    functions: Functions,
    addresses: RangeInclusive<u16>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Functions {
    Any,
    Read,
    Write,
    One(u8),
}

/// An item that is not a permission.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "roles={0} is not ROLE:FUNCTION or ROLE:FUNCTION@FIRST-LAST; FUNCTION is any, read, write, 1 to 6, 8, 15, 16, 17 or 43 (22 and 23 \
     read and write), such as operator:read@0-36"
)]
pub struct NoPermission(String);

impl FromStr for Roles {
    type Err = NoPermission;

    fn from_str(text: &str) -> Result<Self, NoPermission> {
        let items = text.split(',').map(str::trim).filter(|item| !item.is_empty());
        items
            .map(|item| permission(item).ok_or_else(|| NoPermission(item.into())))
            .collect::<Result<_, _>>()
            .map(Self)
    }
}

fn permission(item: &str) -> Option<Permission> {
    let (role, access) = item.split_once(':')?;
    let (functions, addresses) = match access.split_once('@') {
        Some((functions, addresses)) => (functions, addresses),
        None => (access, "0-65535"),
    };
    let (first, last) = addresses.split_once('-').unwrap_or((addresses, addresses));
    let addresses = first.trim().parse().ok()?..=last.trim().parse().ok()?;
    let functions = match functions.trim() {
        "any" => Functions::Any,
        "read" => Functions::Read,
        "write" => Functions::Write,
        "5" => Functions::One(15),
        "6" => Functions::One(16),
        number => Functions::One(number.parse().ok().filter(|n| matches!(n, 1..=4 | 8 | 15 | 16 | 17 | 43))?),
    };
    let is_good = !role.trim().is_empty() && !addresses.is_empty();
    is_good.then(|| Permission { role: role.trim().into(), functions, addresses })
}

impl Roles {
    /// Returns whether every client may do everything.
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns whether a client with this role has this access; `None` is a client without a role.
    pub fn allows(&self, role: Option<&str>, access: Access) -> bool {
        let last = access.address.saturating_add(access.quantity.saturating_sub(1));
        self.is_empty()
            || self.0.iter().any(|permission| {
                Some(&*permission.role) == role
                    && permission.functions.has(access.function)
                    && permission.addresses.contains(&access.address)
                    && permission.addresses.contains(&last)
            })
    }
}

impl Functions {
    const fn has(self, function: u8) -> bool {
        match self {
            Self::Any => true,
            Self::Read => matches!(function, 1..=4),
            Self::Write => matches!(function, 15 | 16),
            Self::One(one) => one == function,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_role_permits_functions_at_addresses() {
        let roles: Roles = "operator:read@0-36, engineer:any,engineer2:6@100,engineer2:43".parse().unwrap();
        let allows =
            |role, function, address, quantity| roles.allows(role, Access { function, address, quantity });
        let operator = Some("operator");
        assert!(allows(operator, 3, 0, 37) && allows(operator, 1, 36, 1));
        assert!(!allows(operator, 3, 0, 38) && !allows(operator, 3, 37, 1) && !allows(operator, 16, 0, 1));
        assert!(allows(Some("engineer"), 16, 65_535, 1) && allows(Some("engineer"), 17, 0, 0));
        let second = Some("engineer2");
        assert!(allows(second, 16, 100, 1) && allows(second, 43, 2, 1) && !allows(second, 16, 100, 2));
        assert!(!allows(None, 3, 0, 1) && !allows(Some("Operator"), 3, 0, 1) && !allows(Some(""), 3, 0, 1));
        assert!(Roles::default().allows(None, Access { function: 16, address: 0, quantity: 1 }));
        assert_eq!("".parse(), Ok(Roles::default()));
        for wrong in
            ["operator", ":read", "a:22", "a:7", "a:read@", "a:read@9-3", "a:read@0-65536", "a:reads"]
        {
            let error = wrong.parse::<Roles>().unwrap_err();
            assert_eq!(error, NoPermission(wrong.into()), "{error}");
        }
    }
}
